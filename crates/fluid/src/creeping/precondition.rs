//! Block-triangular preconditioner: viscous solves, then the pressure that the divergence of their answer asks for.
//!
//! ũ = Â⁻¹ r_u,   p̃ = Ŝ⁻¹ (r_p − D ũ),   Ŝ⁻¹ = ν M⁻¹ + s L⁻¹
//!
//! (Cahouet & Chabert 1988): M the dual volumes, L the compact Poisson operator, s the rate of the time step. Bodies join Â by their lowest
//! modes (`modes`), and those much larger than ℓ join Ŝ⁻¹ as porous media, √(κφ) L⁻¹ √(κφ).

use super::modes::{ACCURATE, BodyModes};
use crate::boundary::Boundary;
use crate::inverse::Inverse;
use crate::operators::Operators;
use crate::rows::{self, nothing};
use fibreflow_mesh::LocalMesh;
use fibreflow_solve::{CgSettings, ConjugateGradients, SolveError};

/// Residual reduction of the inner solves.
const INNER: CgSettings = CgSettings {
    relative_tolerance: 0.1,
    absolute_tolerance: 0.0,
    max_iterations: 200,
};

pub(super) struct BlockPreconditioner {
    /// Nodes whose velocity component is fixed, total, and which of `viscous` solves each component.
    fixed: Vec<Vec<bool>>,
    solver: [usize; 3],
    /// V (s/ν − L) by kind of component.
    viscous: Vec<Inverse>,
    /// −V L for the pressure; needed in time-dependent flow.
    poisson: Option<Inverse>,
    /// s that `viscous` was built for.
    rate: f64,
    /// The mesh is one element thick.
    flat: bool,
    /// √(Σ κφ) by owned node of bodies that hold most of their pressure by themselves \[s^(−½)\]; empty without.
    pub resistance: Vec<f64>,
    /// The bodies in the viscous solves.
    pub modes: BodyModes,
    /// Direct solves are wanted where they are possible.
    directly: bool,
    krylov: ConjugateGradients<f64>,
    /// Owned and total.
    rhs: Vec<f64>,
    answer: Vec<f64>,
}

impl BlockPreconditioner {
    pub fn new(mesh: &LocalMesh, boundary: &Boundary, directly: bool) -> Self {
        let mut masks: [Vec<bool>; 3] = std::array::from_fn(|_| boundary.velocity_fixed.clone());
        let mut marks = vec![0u8; mesh.total()];
        for constraint in &boundary.constraints {
            for c in 0..3 {
                // A slip plane across axis c.
                if constraint.projector[c][c] < 1e-9 {
                    marks[constraint.node as usize] |= 1 << c;
                }
            }
        }
        mesh.halo.update(&mut marks);
        for (c, mask) in masks.iter_mut().enumerate() {
            mask.iter_mut()
                .zip(&marks)
                .for_each(|(m, mark)| *m |= mark & (1 << c) != 0);
        }
        let (mut fixed, mut solver) = (Vec::<Vec<bool>>::new(), [0; 3]);
        for (c, mask) in masks.into_iter().enumerate() {
            let differs = |f: &Vec<bool>| mesh.halo.communicator().any(*f != mask);
            let same: Vec<bool> = fixed.iter().map(|f| !differs(f)).collect();
            solver[c] = same.iter().position(|&s| s).unwrap_or_else(|| {
                fixed.push(mask);
                fixed.len() - 1
            });
        }
        Self {
            fixed,
            solver,
            viscous: Vec::new(),
            poisson: None,
            rate: f64::NAN,
            flat: is_flat(mesh),
            resistance: Vec::new(),
            modes: BodyModes::default(),
            directly,
            krylov: ConjugateGradients::new(),
            rhs: vec![0.0; mesh.owned()],
            answer: vec![0.0; mesh.total()],
        }
    }

    /// Fits the hierarchies to a rate s \[1/s\]. Collective.
    pub fn prepare(
        &mut self,
        mesh: &LocalMesh,
        operators: &Operators,
        boundary: &Boundary,
        (rate, viscosity): (f64, f64),
    ) -> Result<(), SolveError> {
        if rate != self.rate {
            self.viscous.clear();
            for fixed in &self.fixed {
                let mass = rate / viscosity;
                let inverse = Inverse::new(mesh, operators, fixed, mass, self.directly)?;
                self.viscous.push(inverse);
            }
            self.rate = rate;
            self.modes.forget();
        }
        let room = (&mut self.rhs[..], &mut self.answer[..]);
        let kinds = (self.solver, viscosity);
        let communicator = operators.communicator();
        self.modes.prepare(
            &mut self.viscous,
            kinds,
            &mut self.krylov,
            room,
            communicator,
        )?;
        if (rate > 0.0 || !self.resistance.is_empty()) && self.poisson.is_none() {
            let fixed = &boundary.pressure_fixed;
            let inverse = Inverse::new(mesh, operators, fixed, 0.0, self.directly)?;
            self.poisson = Some(inverse);
        }
        Ok(())
    }

    /// Which components of momentum have a residual: across the plane of a two-dimensional flow nothing happens. One element thick
    /// meshes only are asked. Collective.
    fn busy(&self, operators: &Operators, r: &[[f64; 4]]) -> [bool; 3] {
        if !self.flat {
            return [true; 3];
        }
        let mut counts = [0.0; 3];
        for r in r {
            (0..3).for_each(|c| counts[c] += f64::from(u8::from(r[c] != 0.0)));
        }
        operators.communicator().sum_slice(&mut counts);
        counts.map(|n| n > 0.0)
    }

    /// z from r; the halo of z is not set.
    pub fn apply(
        &mut self,
        operators: &Operators,
        boundary: &Boundary,
        (rate, viscosity): (f64, f64),
        r: &[[f64; 4]],
        z: &mut [[f64; 4]],
    ) -> Result<(), SolveError> {
        let volumes = operators.volumes();
        let busy = self.busy(operators, r);
        let inner = if self.modes.active() { ACCURATE } else { INNER };
        for c in 0..3 {
            if !busy[c] {
                rows::each(&mut z[..r.len()], |_, z| z[c] = 0.0);
                continue;
            }
            rows::each(&mut self.rhs, |i, rhs| *rhs = r[i][c] / viscosity);
            let inverse = &mut self.viscous[self.solver[c]];
            inverse.solve(&mut self.krylov, &self.rhs, &mut self.answer, &inner)?;
            let answer = &self.answer;
            rows::each(&mut z[..r.len()], |i, z| z[c] = answer[i]);
        }
        if self.modes.active() {
            self.modes.weigh(z, operators.communicator());
            for k in 0..self.modes.axes().len() {
                let c = self.modes.axes()[k];
                if !busy[c] {
                    continue;
                }
                self.modes.subtract(k, viscosity, &mut self.rhs);
                let inverse = &mut self.viscous[self.solver[c]];
                inverse.solve(&mut self.krylov, &self.rhs, &mut self.answer, &inner)?;
                let answer = &self.answer;
                rows::each(&mut z[..r.len()], |i, z| z[c] += answer[i]);
            }
        }
        for constraint in &boundary.constraints {
            let z = &mut z[constraint.node as usize];
            *z = constraint.admit(*z);
        }
        let out = (&mut self.rhs[..], &mut nothing(r.len())[..]);
        operators.divergence(z, out, |i, divergence, rhs, ()| *rhs = r[i][3] - divergence);
        for &(i, _) in &boundary.outlets {
            self.rhs[i as usize] = 0.0;
        }
        let rhs = &self.rhs;
        rows::each(&mut z[..r.len()], |i, z| {
            z[3] = viscosity / volumes[i] * rhs[i]
        });
        if !self.resistance.is_empty()
            && let Some(inverse) = &mut self.poisson
        {
            // Inside a body the flow is that through a porous medium.
            let root = &self.resistance;
            let divergence = self.rhs.clone();
            rows::each(&mut self.rhs, |i, rhs| *rhs *= root[i]);
            inverse.solve(&mut self.krylov, &self.rhs, &mut self.answer, &INNER)?;
            let answer = &self.answer;
            rows::each(&mut z[..r.len()], |i, z| z[3] += root[i] * answer[i]);
            self.rhs.copy_from_slice(&divergence);
        }
        if rate > 0.0
            && let Some(inverse) = &mut self.poisson
        {
            inverse.solve(&mut self.krylov, &self.rhs, &mut self.answer, &INNER)?;
            let answer = &self.answer;
            rows::each(&mut z[..r.len()], |i, z| z[3] += rate * answer[i]);
        }
        Ok(())
    }
}

/// All nodes have the same x, y or z. Collective.
fn is_flat(mesh: &LocalMesh) -> bool {
    let communicator = mesh.halo.communicator();
    let extent = |c: usize| {
        let owned = mesh.nodes[..mesh.owned()].iter().map(|x| x[c]);
        let low = owned.clone().fold(f64::INFINITY, f64::min);
        let high = owned.fold(f64::NEG_INFINITY, f64::max);
        communicator.max(high) - communicator.min(low)
    };
    [extent(0), extent(1), extent(2)].contains(&0.0)
}
