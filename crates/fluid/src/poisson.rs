//! The pressure equation: its matrix, how it is solved, and why so.

use crate::boundary::Boundary;
use crate::operators::Operators;
use crate::polynomial::Polynomial;
use crate::{FluidError, FluidSettings, PressurePreconditioner, Projections};
use fibreflow_mesh::{DualGeometry, LocalMesh};
use fibreflow_solve::{
    Amg, AmgSettings, CgSettings, ConjugateGradients, Deflation, DeflationSettings, Direct, Jacobi,
    NullSpace, PairMatrix, PastSolutions, Preconditioner, SolveError,
};

/// Operations of a direct solve, by node, above which `Auto` takes multigrid.
///
/// Products with eigenvectors were measured at 35 operations a nanosecond (AVX2, one thread), CG–AMG at 0.8 µs a node or
/// more on tensor-product meshes: this is half of it, as setting up takes n³ operations a direction as well.
pub(crate) const DEAREST_DIRECT: f64 = 15000.0;

/// What the pressure equation needs besides the flow.
pub(crate) struct Pressure {
    pub matrix: PairMatrix,
    solver: Solver,
    pub choice: PressureChoice,
    pub polynomial: Polynomial,
    null_space: NullSpace,
    /// Total: ψ \[m²/s\].
    pub psi: Vec<f64>,
    /// Owned: minus the divergence of F* \[m³/s\].
    pub rhs: Vec<f64>,
}

enum Solver {
    Direct(Box<Direct>),
    Iterative {
        preconditioner: Box<dyn Preconditioner<f64> + Send + Sync>,
        krylov: Box<ConjugateGradients<f64>>,
        past: Box<PastSolutions>,
    },
}

/// Past solutions that the initial guess is made of. On a turbulent channel four save 1.3 to 1.8 of 11 iterations to 1e-8
/// against extrapolation in time, and as many more save little.
pub(crate) const PAST: usize = 4;

/// How a projection went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Projection {
    /// Iterations of the pressure solve, one where it is direct.
    pub iterations: usize,
    /// Norm of the predicted divergence before and after the solve \[m³/s\]. Direct solves leave round-off and do not
    /// measure it: [`crate::Fluid::divergence_max`] does.
    pub residual: Option<[f64; 2]>,
}

impl Pressure {
    pub fn new(
        mesh: &LocalMesh,
        geometry: &DualGeometry,
        operators: &Operators,
        boundary: &Boundary,
        settings: &FluidSettings,
    ) -> Result<Self, FluidError> {
        let preconditioner = settings.preconditioner;
        let failed = |source| FluidError::Solve {
            equation: "pressure",
            source,
        };
        let matrix =
            PairMatrix::new(mesh, geometry, &boundary.pressure_fixed, None).map_err(failed)?;
        let (direct, reason) = match preconditioner {
            PressurePreconditioner::Auto | PressurePreconditioner::Direct => {
                try_direct(mesh, geometry, boundary, preconditioner)?
            }
            PressurePreconditioner::Amg
            | PressurePreconditioner::Deflation
            | PressurePreconditioner::Jacobi => (None, PressureReason::AsSet),
        };
        let directions = direct.as_ref().map(|direct| direct.describe());
        let (solver, used) = match (direct, preconditioner) {
            (Some(direct), _) => (Solver::Direct(direct), PressurePreconditioner::Direct),
            (None, PressurePreconditioner::Jacobi) => (
                Solver::iterative(mesh, Jacobi::new(&matrix)),
                PressurePreconditioner::Jacobi,
            ),
            (None, PressurePreconditioner::Deflation) => {
                let deflation = Deflation::new(&matrix, DeflationSettings::default());
                (
                    Solver::iterative(mesh, deflation.map_err(failed)?),
                    PressurePreconditioner::Deflation,
                )
            }
            (None, _) => {
                let amg = Amg::new(&matrix, AmgSettings::default()).map_err(failed)?;
                (Solver::iterative(mesh, amg), PressurePreconditioner::Amg)
            }
        };
        let null_space = if matrix.is_singular() {
            NullSpace::Constant
        } else {
            NullSpace::None
        };
        Ok(Self {
            solver,
            choice: PressureChoice {
                preconditioner: used,
                solves: match settings.projections {
                    Projections::Auto if directions.is_some() => 3,
                    Projections::EverySubStep => 3,
                    Projections::Auto | Projections::Once => 1,
                },
                directions,
                reason,
            },
            polynomial: Polynomial::new(mesh, operators, &boundary.pressure_fixed),
            matrix,
            null_space,
            psi: vec![0.0; mesh.total()],
            rhs: vec![0.0; mesh.owned()],
        })
    }

    /// Past solutions, where they are of use.
    pub fn past(&self) -> Option<&PastSolutions> {
        match &self.solver {
            Solver::Direct(_) => None,
            Solver::Iterative { past, .. } => Some(past),
        }
    }

    /// As [`Pressure::past`], to be restored.
    pub fn past_mut(&mut self) -> Option<&mut PastSolutions> {
        match &mut self.solver {
            Solver::Direct(_) => None,
            Solver::Iterative { past, .. } => Some(past),
        }
    }

    /// Clears the history of the initial guess.
    pub fn forget(&mut self) {
        if let Some(past) = self.past_mut() {
            past.clear();
        }
    }

    /// ψ from past solutions for the right-hand side. Direct solves need no guess. Collective.
    pub fn guess(&mut self) {
        if let Solver::Iterative { past, .. } = &mut self.solver {
            past.guess(&self.rhs, &mut self.psi);
        }
    }

    /// Takes the solution for guesses to come, after [`Pressure::guess`] and a solve that did not find it good enough.
    /// Collective.
    pub fn remember(&mut self) {
        if let Solver::Iterative { past, .. } = &mut self.solver {
            past.remember(&self.rhs, &self.psi);
        }
    }

    /// ψ of the right-hand side, halo entries up to date. One application of the exact inverse is the answer to round-off:
    /// no iteration follows it. Collective.
    pub fn solve(&mut self, settings: &CgSettings) -> Result<Projection, SolveError> {
        match &mut self.solver {
            Solver::Direct(direct) => {
                direct.solve(&self.rhs, &mut self.psi);
                self.matrix.halo().update(&mut self.psi);
                Ok(Projection {
                    iterations: 1,
                    residual: None,
                })
            }
            Solver::Iterative {
                preconditioner,
                krylov,
                ..
            } => {
                let report = krylov.solve(
                    &self.matrix,
                    &mut **preconditioner,
                    &self.rhs,
                    &mut self.psi,
                    settings,
                    self.null_space,
                )?;
                Ok(Projection {
                    iterations: report.iterations,
                    residual: Some([report.initial_residual, report.final_residual]),
                })
            }
        }
    }
}

impl Solver {
    fn iterative(
        mesh: &LocalMesh,
        preconditioner: impl Preconditioner<f64> + Send + Sync + 'static,
    ) -> Self {
        let past = PastSolutions::new(mesh.halo.communicator(), mesh.owned(), PAST);
        Self::Iterative {
            preconditioner: Box::new(preconditioner),
            krylov: Box::new(ConjugateGradients::new()),
            past: Box::new(past),
        }
    }
}

/// The direct solver where it is possible and, unless it was asked for, cheap; why or why not.
fn try_direct(
    mesh: &LocalMesh,
    geometry: &DualGeometry,
    boundary: &Boundary,
    preconditioner: PressurePreconditioner,
) -> Result<(Option<Box<Direct>>, PressureReason), FluidError> {
    let wanted = preconditioner == PressurePreconditioner::Direct;
    let refused = |reason: PressureReason| {
        if wanted {
            return Err(FluidError::NoDirect(reason));
        }
        Ok((None, reason))
    };
    let Some(tensor) = &geometry.tensor else {
        return refused(PressureReason::NotTensorProduct);
    };
    let ends = Direct::fixed_ends(&mesh.halo, &tensor.grid, &boundary.pressure_fixed);
    let Some(ends) = ends else {
        return refused(PressureReason::PartOfAnEnd);
    };
    let operations = Direct::estimate(&tensor.lines, ends) / mesh.total_nodes as f64;
    if !wanted && operations > DEAREST_DIRECT {
        return refused(PressureReason::TooDear { operations });
    }
    let direct = Direct::new(&mesh.halo, &tensor.grid, &tensor.lines, ends, 0.0);
    let direct = direct.map_err(|source| FluidError::Solve {
        equation: "pressure",
        source,
    })?;
    let reason = if wanted {
        PressureReason::AsSet
    } else {
        PressureReason::TensorProduct { operations }
    };
    Ok((Some(Box::new(direct)), reason))
}

/// How the pressure equation is solved, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct PressureChoice {
    /// What is used: never [`PressurePreconditioner::Auto`].
    pub preconditioner: PressurePreconditioner,
    /// How each direction is solved, where the solver is direct.
    pub directions: Option<String>,
    /// Solves a step.
    pub solves: usize,
    /// What decided it.
    pub reason: PressureReason,
}

/// What decided how the pressure equation is solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PressureReason {
    /// The settings.
    AsSet,
    /// The mesh is a tensor product, and a direct solve of few operations a node.
    TensorProduct {
        /// Operations a node.
        operations: f64,
    },
    /// The mesh is not a tensor product.
    NotTensorProduct,
    /// Nodes of given pressure are not whole ends of the mesh.
    PartOfAnEnd,
    /// A direct solve takes too many operations.
    TooDear {
        /// Operations a node.
        operations: f64,
    },
}

impl std::fmt::Display for PressureReason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::AsSet => f.write_str("as set"),
            Self::TensorProduct { operations } => {
                write!(
                    f,
                    "the mesh is a tensor product, {operations:.0} operations a node"
                )
            }
            Self::NotTensorProduct => f.write_str(
                "the nodes of the mesh are not the tensor product of three coordinate lists",
            ),
            Self::PartOfAnEnd => {
                f.write_str("the nodes of given pressure are not whole sides of the box")
            }
            Self::TooDear { operations } => write!(
                f,
                "a direct solve would take {operations:.0} operations a node, more than {DEAREST_DIRECT}"
            ),
        }
    }
}

impl std::fmt::Display for PressureChoice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match (self.preconditioner, &self.directions) {
            (_, Some(directions)) => write!(f, "pressure solved directly ({directions})")?,
            (PressurePreconditioner::Deflation, None) => {
                f.write_str("pressure by conjugate gradients with deflation")?;
            }
            (PressurePreconditioner::Jacobi, None) => {
                f.write_str("pressure by conjugate gradients with the diagonal")?;
            }
            _ => f.write_str("pressure by conjugate gradients with multigrid")?,
        }
        let often = if self.solves > 1 {
            "after every sub-step"
        } else {
            "once a step"
        };
        write!(f, ", {often}: {}", self.reason)
    }
}
