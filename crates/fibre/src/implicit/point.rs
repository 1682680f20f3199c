//! Hydrodynamic points of a fibre in the present iterate: drag and its derivatives.

use super::Action;
use crate::hydrodynamics::{DragResponse, Resistance, Section, TorqueLaw, spin};
use crate::integrate::{Batch, Flow};
use crate::linear_slip::{LinearSlip, for_arms};
use crate::system::FibreConstants;
use crate::{Matrix3, Vector3};

/// Where a point is and what flows there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Site {
    /// Nodes between which it lies, and the part of the way.
    ends: [usize; 2],
    xi: f64,
    weight: f64,
    arm: f64,
    velocity: Vector3,
    gradient: Matrix3,
}

/// Two points that feel what all points of a straight rigid fibre feel together, and the laws of all of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gathered {
    sites: [Site; 2],
    laws: Laws,
}

/// Laws that are the same all along a fibre; the torque of the strain rate is not set.
#[derive(Clone, Copy, Debug)]
struct Laws {
    drag: Resistance,
    torque: TorqueLaw,
}

impl Batch<'_> {
    /// Calls `visit(segment, point, …)` for the hydrodynamic points of the fibre, in the flow at `moment` of the step; derivatives
    /// of the drag are zero without `SLOPES`.
    pub(super) fn for_points<const SLOPES: bool>(
        &self,
        action: &Action,
        moment: f64,
        mut visit: impl FnMut(usize, usize, &Point),
    ) {
        let Some(flow) = action.flow else { return };
        let model = action.model;
        let constants = &model.fibres[self.fibres.start];
        let mut section = Section::middle(2.0 * constants.material.radius, constants.length);
        let segments = model.segment_range(self.fibres.start);
        let first = model.points[segments.start];
        for_arms(model, self.fibres.start, |i, k, xi, weight, arm| {
            let (segment, p) = (&model.segments[segments.start + i], first + k);
            section.diameter = 2.0 * segment.radius;
            section.segment_length = segment.rest_length;
            section.place = 2.0 * arm / constants.length;
            let (velocity, gradient) = match flow.formula {
                Some(formula) => {
                    let span = self.position[i + 1] - self.position[i];
                    formula(&(self.position[i] + span * xi), moment)
                }
                None => (
                    flow.ambient.velocity_at(p, moment),
                    *flow.ambient.gradient_at(p),
                ),
            };
            let site = Site {
                ends: [i, i + 1],
                xi,
                weight,
                arm,
                velocity,
                gradient,
            };
            visit(
                i,
                k,
                &self.meet::<SLOPES>(&flow, constants, &section, &site, Known::Flow(p)),
            );
        });
    }

    /// Where resistances are the same all along: points with the Σ w, Σ w σ, Σ w σ², Σ w u, Σ w σ u and mean gradient of the fibre's.
    pub(super) fn gathered(&self, action: &Action, moment: f64) -> Option<Gathered> {
        let flow = action.flow?;
        let uniform = flow.law.drag.uniform() && flow.law.torque.uniform();
        if !uniform || flow.formula.is_some() || !flow.ambient.yielding.is_empty() {
            return None;
        }
        let (model, fibre) = (action.model, self.fibres.start);
        let first = model.points[model.segment_range(fibre).start];
        let (mut whole, mut spread) = (0.0, 0.0);
        let (mut mean, mut linear) = (Vector3::zeros(), Vector3::zeros());
        let mut gradient = Matrix3::zeros();
        for_arms(model, fibre, |_, k, _, weight, arm| {
            let velocity = flow.ambient.velocity_at(first + k, moment);
            whole += weight;
            spread += weight * arm * arm;
            mean += velocity * weight;
            linear += velocity * (weight * arm);
            gradient += flow.ambient.gradient_at(first + k) * weight;
        });
        let reach = (spread / whole).sqrt();
        let last = self.position.len() - 1;
        let constants = &model.fibres[fibre];
        let sites = [-reach, reach].map(|arm| Site {
            ends: [0, last],
            xi: 0.5 + arm / constants.length,
            weight: 0.5 * whole,
            arm,
            velocity: mean / whole + linear * (arm / spread),
            gradient: gradient / whole,
        });
        let section = Section::middle(2.0 * constants.material.radius, constants.length);
        let (law, zero) = (flow.law, Vector3::zeros());
        let laws = Laws {
            drag: law
                .drag
                .resistance(&Vector3::x(), &zero, &section, &law.fluid),
            torque: law
                .torque
                .torque(&zero, &Matrix3::zeros(), &section, &law.fluid),
        };
        Some(Gathered { sites, laws })
    }

    /// Calls `visit` for the points of a rigid fibre, or for those that stand for them.
    pub(super) fn for_body_points(
        &self,
        action: &Action,
        gathered: Option<&Gathered>,
        moment: f64,
        mut visit: impl FnMut(&Point),
    ) {
        let (Some(flow), Some(gathered)) = (action.flow, gathered) else {
            return self.for_points::<true>(action, moment, |_, _, point| visit(point));
        };
        let constants = &action.model.fibres[self.fibres.start];
        let section = Section::middle(2.0 * constants.material.radius, constants.length);
        for site in &gathered.sites {
            visit(&self.meet::<true>(
                &flow,
                constants,
                &section,
                site,
                Known::Laws(&gathered.laws),
            ));
        }
    }

    /// [`Batch::exchange`] of a straight rigid fibre with the same laws all along.
    pub(super) fn exchange_gathered(
        &mut self,
        action: &Action,
        gathered: &Gathered,
        share: f64,
        moment: f64,
    ) {
        let Some(flow) = action.flow else { return };
        let (model, fibre) = (action.model, self.fibres.start);
        let first = model.points[model.segment_range(fibre).start];
        let last = self.position.len() - 1;
        let tangent = (self.position[last] - self.position[0]).normalize();
        let (middle, stretch) = (
            (self.velocity[0] + self.velocity[last]) * 0.5,
            (self.velocity[last] - self.velocity[0]) / model.fibres[fibre].length,
        );
        let angular_velocity = self.angular_velocity[0];
        let force = std::mem::take(&mut self.reaction_force);
        let torque = std::mem::take(&mut self.reaction_torque);
        let Laws { drag, torque: law } = &gathered.laws;
        let linear = self.linear_part(action);
        let mut linear_slip = LinearSlip::zero();
        for_arms(model, fibre, |_, k, _, weight, arm| {
            let p = first + k;
            let slip = flow.ambient.velocity_at(p, moment) - middle - stretch * arm;
            force[k] -= drag.force(&tangent, &slip) * (share * weight);
            let gradient = flow.ambient.gradient_at(p);
            let local = law.at(&tangent, gradient);
            torque[k] -= local.torque(&tangent, gradient, &angular_velocity) * (share * weight);
            if linear.is_some() {
                linear_slip.add(weight * arm, arm, &slip, drag, 1.0);
            }
        });
        if let Some(linear) = linear {
            let drag = self.linear_drag(action, &linear, &linear_slip);
            let pull = drag.tensor * linear_slip.moment * share;
            for_arms(model, fibre, |_, k, _, weight, arm| {
                force[k] -= pull * (weight * arm)
            });
        }
        self.reaction_force = force;
        self.reaction_torque = torque;
    }

    /// What a point feels.
    #[inline(always)]
    fn meet<const SLOPES: bool>(
        &self,
        flow: &Flow,
        constants: &FibreConstants,
        section: &Section,
        site: &Site,
        known: Known,
    ) -> Point {
        let law = flow.law;
        let Site {
            ends: [a, b],
            xi,
            weight,
            gradient,
            ..
        } = *site;
        let span = self.position[b] - self.position[a];
        let length = span.norm();
        let t = span / length;
        let slip = site.velocity - self.velocity[a] * (1.0 - xi) - self.velocity[b] * xi;
        let rotation = spin(&gradient);
        let angular_velocity = if constants.twist_free {
            // About its tangent it spins with the fluid.
            let relative = self.velocity[b] - self.velocity[a];
            [t.cross(&relative) / length + t * t.dot(&rotation); 2]
        } else {
            [self.angular_velocity[a], self.angular_velocity[b]]
        };
        let (drag, torque, left) = match known {
            Known::Laws(laws) => {
                let drag = DragResponse {
                    resistance: laws.drag,
                    by_slip: laws.drag.tensor(&t),
                    by_tangent: laws.drag.turning(&t, &slip),
                };
                (drag, laws.torque.at(&t, &gradient), 1.0)
            }
            Known::Flow(p) => {
                let torque = law.torque.torque(&t, &gradient, section, &law.fluid);
                let (drag, left) = if SLOPES {
                    let drag = law.drag.response(&t, &slip, section, &law.fluid);
                    flow.ambient.yielded_response(p, drag, weight, &t, &slip)
                } else {
                    let drag = law.drag.resistance(&t, &slip, section, &law.fluid);
                    let (resistance, left) = flow.ambient.yielded(p, drag, weight);
                    let drag = DragResponse {
                        resistance,
                        by_slip: Matrix3::zeros(),
                        by_tangent: Matrix3::zeros(),
                    };
                    (drag, left)
                };
                (drag, torque, left)
            }
        };
        Point {
            xi,
            weight,
            arm: site.arm,
            position: self.position[a] + span * xi,
            tangent: t,
            span,
            length,
            slip,
            spin: rotation,
            gradient,
            steepness: flow.formula.map_or_else(Matrix3::zeros, |_| gradient),
            angular_velocity,
            drag,
            left,
            spin_drag: Resistance {
                normal: torque.resistance_normal,
                axial: torque.resistance_axial,
            },
            strain_torque: torque.strain_torque,
            torque,
        }
    }
}

/// What is known of a point beforehand.
enum Known<'a> {
    /// Its number in the flow.
    Flow(usize),
    /// The laws, and that the flow does not give way.
    Laws(&'a Laws),
}

/// A hydrodynamic point in the present state.
pub(super) struct Point {
    pub xi: f64,
    pub weight: f64,
    /// σ, length from the fibre's middle.
    pub arm: f64,
    pub position: Vector3,
    pub tangent: Vector3,
    /// Between the nodes around it.
    pub span: Vector3,
    length: f64,
    pub slip: Vector3,
    /// Ω of the flow.
    pub spin: Vector3,
    gradient: Matrix3,
    /// Gradient of a flow that is followed in space.
    pub steepness: Matrix3,
    /// Of the two nodes.
    pub angular_velocity: [Vector3; 2],
    pub drag: DragResponse,
    /// What is left of the law's drag across where the flow gives way.
    pub left: f64,
    pub spin_drag: Resistance,
    pub strain_torque: Vector3,
    torque: TorqueLaw,
}

impl Point {
    /// Drag of the point's length \[N\].
    pub fn force(&self) -> Vector3 {
        let r = &self.drag.resistance;
        r.force(&self.tangent, &self.slip) * self.weight
    }

    /// Resistance to spin by length.
    pub fn spin_tensor(&self) -> Matrix3 {
        self.spin_drag.tensor(&self.tangent)
    }

    /// Change of the slip by a displacement of the point that ends a stage of `tau`, with the sign turned.
    pub fn rate(&self, tau: f64) -> Matrix3 {
        Matrix3::identity() / tau - self.steepness
    }

    /// Minus the derivative of the drag by a displacement of the point that ends a stage of `tau`; and its derivative by
    /// the span x_b − x_a of the point's segment.
    pub fn derivatives(&self, tau: f64) -> (Matrix3, Matrix3) {
        let by_slip = self.drag.by_slip * self.rate(tau) * self.weight;
        (by_slip, self.drag.by_tangent * self.turning() * self.weight)
    }

    /// Derivative of the torque of the point's length, at this spin of the fibre, by the span.
    pub fn torque_by_span(&self, angular_velocity: &Vector3) -> Matrix3 {
        let t = &self.tangent;
        let by_tangent = self.torque.by_tangent(t, &self.gradient, angular_velocity);
        by_tangent * self.turning() * self.weight
    }

    /// Derivative of the tangent by the span.
    fn turning(&self) -> Matrix3 {
        let t = &self.tangent;
        (Matrix3::identity() - t * t.transpose()) / self.length
    }
}
