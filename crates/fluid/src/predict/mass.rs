//! The dispersion that lumped mass causes, taken out (Guermond & Pasquetti 2013).
//!
//! Pairs of the Galerkin form are linear finite elements whose mass M_ij = ∫N_i N_j is lumped to V: the leading error
//! of waves that are carried along. Two terms of M⁻¹ = (I + A + A² + …) V⁻¹, A = V⁻¹(V − M), take it out without a
//! solve. With r all that changes momentum in a sub-step, the increment of the velocity is
//!
//! | diffusion | increment δ = δ₂ |
//! |---|---|
//! | explicit | δ_k = δ_0 + V⁻¹(V − M) δ_(k−1),  V δ_0 = r |
//! | implicit, H = V − ½ α Δt ν V L | H δ_k = r + (V − M) δ_(k−1),  H δ_0 = r |
//!
//! (V − M) x_i = Σ_j m_ij (x_i − x_j) runs over antisymmetric pairs: momentum is that of the lumped scheme, to
//! round-off. Both maps r → δ are symmetric and positive, so skew convection conserves energy, in the norm of the
//! inverse; and r = 0 is the same steady state. What is left of a wave's speed on a line is (kh)⁴/180 of it, that of the consistent mass; with
//! one term it is (kh)⁴/30, as of central differences of fourth order.

use crate::Fluid;

impl Fluid {
    /// Takes increments δ_0 in `momentum.next` and leaves u + δ there.
    pub(crate) fn correct_step(&mut self) {
        self.confine_increment();
        std::mem::swap(&mut self.momentum.next, &mut self.momentum.increment);
        self.add_lumping_error();
        let inverse = self.operators.inverse_volumes();
        let (velocity, momentum) = (&self.velocity, &mut self.momentum);
        self.operators.lumping_error(
            &mut momentum.next,
            &mut momentum.increment[..inverse.len()],
            |i, _, error, first| {
                *first = std::array::from_fn(|c| velocity[i][c] + first[c] + inverse[i] * error[c]);
            },
        );
        std::mem::swap(&mut self.momentum.next, &mut self.momentum.increment);
    }

    /// What constraints leave of δ_1 = δ_0 + V⁻¹(V − M) δ_0 into `momentum.next`, for δ_0 in `momentum.increment`. Nothing is
    /// booked: only the last increment changes momentum.
    fn add_lumping_error(&mut self) {
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
            let i = constraint.node as usize;
            momentum.next[i] = if self.boundary.velocity_fixed[i] {
                momentum.increment[i]
            } else {
                constraint.admit(momentum.next[i])
            };
        }
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

    /// Adds (V − M) x to the right-hand side of the implicit increment, for x in `momentum.change`; what constraints
    /// take out goes to `reaction`.
    pub(super) fn correct_right_side(&mut self) {
        let momentum = &mut self.momentum;
        let rhs = &mut momentum.next[..self.operators.volumes().len()];
        self.operators
            .lumping_error(&mut momentum.change, rhs, |_, _, error, rhs| {
                (0..3).for_each(|c| rhs[c] += error[c]);
            });
        for (constraint, reaction) in self.boundary.constraints.iter().zip(&mut self.reaction) {
            let rhs = &mut rhs[constraint.node as usize];
            let admitted = constraint.admit(*rhs);
            (0..3).for_each(|c| reaction[c] += rhs[c] - admitted[c]);
            *rhs = admitted;
        }
    }

    /// δ for the rate of change δ_0 in `momentum.increment`, which constraints admit.
    pub(crate) fn correct_rate(&mut self) {
        self.add_lumping_error();
        let inverse = self.operators.inverse_volumes();
        let momentum = &mut self.momentum;
        self.operators.lumping_error(
            &mut momentum.next,
            &mut momentum.increment[..inverse.len()],
            |i, _, error, first| {
                (0..4).for_each(|c| first[c] += inverse[i] * error[c]);
            },
        );
        for constraint in &self.boundary.constraints {
            let rate = &mut self.momentum.increment[constraint.node as usize];
            *rate = constraint.admit(*rate);
        }
    }
}
