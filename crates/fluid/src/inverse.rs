//! m V − V L inverted: directly where the mesh allows it, else by conjugate gradients with multigrid.

use crate::operators::Operators;
use crate::poisson::DEAREST_DIRECT;
use fibreflow_mesh::LocalMesh;
use fibreflow_solve::{
    Amg, AmgSettings, CgSettings, ConjugateGradients, Direct, NullSpace, PairMatrix, SolveError,
};

/// How m V − V L is inverted.
pub(crate) enum Inverse {
    Direct(Box<Direct>),
    Multigrid(Box<Multigrid>),
}

pub(crate) struct Multigrid {
    matrix: PairMatrix,
    cycle: Amg,
    null_space: NullSpace,
}

impl Inverse {
    /// Directly where the mesh allows it, the nodes of given values are whole sides and it takes few operations. Collective.
    pub fn new(
        mesh: &LocalMesh,
        operators: &Operators,
        fixed: &[bool],
        mass: f64,
        directly: bool,
    ) -> Result<Self, SolveError> {
        if let Some(tensor) = operators.geometry.tensor.as_ref().filter(|_| directly)
            && let Some(ends) = Direct::fixed_ends(&mesh.halo, &tensor.grid, fixed)
            && Direct::estimate(&tensor.lines, ends) <= DEAREST_DIRECT * mesh.total_nodes as f64
        {
            let direct = Direct::new(&mesh.halo, &tensor.grid, &tensor.lines, ends, mass)?;
            return Ok(Self::Direct(Box::new(direct)));
        }
        let shift: Vec<f64> = operators.volumes().iter().map(|v| mass * v).collect();
        let shift = (mass > 0.0).then_some(&shift[..]);
        let matrix = PairMatrix::new(mesh, &operators.geometry, fixed, shift)?;
        let null_space = if matrix.is_singular() {
            NullSpace::Constant
        } else {
            NullSpace::None
        };
        Ok(Self::Multigrid(Box::new(Multigrid {
            cycle: Amg::new(&matrix, AmgSettings::default())?,
            matrix,
            null_space,
        })))
    }

    /// Takes another m > 0 where that is cheap; false where the inverse must be made anew.
    pub fn set(&mut self, mass: f64) -> bool {
        match self {
            Self::Direct(direct) => {
                direct.set(mass, 1.0);
                true
            }
            Self::Multigrid(_) => false,
        }
    }

    /// How each direction is solved, where that is done directly.
    pub fn directions(&self) -> Option<String> {
        match self {
            Self::Direct(direct) => Some(direct.describe()),
            Self::Multigrid(_) => None,
        }
    }

    /// x = A⁻¹ b, by multigrid as `settings` ask.
    pub fn solve(
        &mut self,
        krylov: &mut ConjugateGradients<f64>,
        rhs: &[f64],
        x: &mut [f64],
        settings: &CgSettings,
    ) -> Result<(), SolveError> {
        match self {
            Self::Direct(direct) => direct.solve(rhs, x),
            Self::Multigrid(multigrid) => {
                let Multigrid {
                    matrix,
                    cycle,
                    null_space,
                } = &mut **multigrid;
                x.fill(0.0);
                krylov.solve(matrix, cycle, rhs, x, settings, *null_space)?;
            }
        }
        Ok(())
    }
}
