//! The dispersion that lumped mass causes, taken out (Guermond & Pasquetti 2013).
//!
//! Pairs of the Galerkin form are linear finite elements whose mass M_ij = ∫N_i N_j is lumped to V: the leading error
//! of waves that are carried along. One term of M⁻¹ = (I + A + A² + …) V⁻¹, A = V⁻¹(V − M), takes it out without a
//! solve. With r all that changes momentum in a sub-step, the increment of the velocity is
//!
//! | diffusion | increment |
//! |---|---|
//! | explicit | δ = x + V⁻¹(V − M) x,  V x = r |
//! | implicit, H = V − ½ α Δt ν V L | H δ = r + (V − M) x,  H x = r |
//!
//! (V − M) x_i = Σ_j m_ij (x_i − x_j) runs over antisymmetric pairs: momentum is that of the lumped scheme, to
//! round-off. Both maps r → δ are symmetric and positive, so skew convection conserves energy, in the norm of the
//! inverse; and r = 0 is the same steady state.

use crate::Fluid;

impl Fluid {
    /// Takes increments x in `momentum.next` and leaves u + δ there.
    pub(crate) fn correct_step(&mut self) {
        self.confine_increment();
        std::mem::swap(&mut self.momentum.next, &mut self.momentum.increment);
        let inverse = self.operators.inverse_volumes();
        let (velocity, momentum) = (&self.velocity, &mut self.momentum);
        self.operators.lumping_error(
            &mut momentum.increment,
            &mut momentum.next[..inverse.len()],
            |i, own, error, next| {
                *next = std::array::from_fn(|c| velocity[i][c] + own[c] + inverse[i] * error[c]);
            },
        );
    }

    /// What constraints leave of the increments in `momentum.next`, or what boundaries give; the rest is booked.
    fn confine_increment(&mut self) {
        let mut shifts = self.boundary.shift.iter();
        for (constraint, reaction) in self.boundary.constraints.iter().zip(&mut self.reaction) {
            let i = constraint.node as usize;
            let volume = self.operators.volumes()[i];
            let next = &mut self.momentum.next[i];
            let mut admitted = constraint.admit(*next);
            if self.boundary.velocity_fixed[i] && self.boundary.moves {
                admitted = shifts.next().copied().unwrap_or_default();
            }
            (0..3).for_each(|c| reaction[c] += volume * (next[c] - admitted[c]));
            *next = admitted;
        }
    }

    /// Adds (V − M) x to the right-hand side of the implicit increment, for x in `momentum.increment`; what constraints
    /// take out goes to `reaction`.
    pub(super) fn correct_right_side(&mut self) {
        let momentum = &mut self.momentum;
        let rhs = &mut momentum.next[..self.operators.volumes().len()];
        self.operators
            .lumping_error(&mut momentum.increment, rhs, |_, _, error, rhs| {
                (0..3).for_each(|c| rhs[c] += error[c]);
            });
        for (constraint, reaction) in self.boundary.constraints.iter().zip(&mut self.reaction) {
            let rhs = &mut rhs[constraint.node as usize];
            let admitted = constraint.admit(*rhs);
            (0..3).for_each(|c| reaction[c] += rhs[c] - admitted[c]);
            *rhs = admitted;
        }
    }

    /// x + V⁻¹(V − M) x for the rate of change x in `momentum.increment`, which constraints admit.
    pub(crate) fn correct_rate(&mut self) {
        let inverse = self.operators.inverse_volumes();
        let momentum = &mut self.momentum;
        self.operators.lumping_error(
            &mut momentum.increment,
            &mut momentum.next[..inverse.len()],
            |i, own, error, next| {
                *next = std::array::from_fn(|c| own[c] + inverse[i] * error[c]);
            },
        );
        for constraint in &self.boundary.constraints {
            let next = &mut momentum.next[constraint.node as usize];
            *next = constraint.admit(*next);
        }
        std::mem::swap(&mut momentum.next, &mut momentum.increment);
    }
}
