//! Where the energy of the fibres comes from and goes.
//!
//! Works are taken step by step from what a step moved, whatever the integrator and its sub-steps: constant loads times
//! displacements (exact), the mean force on the fluid times displacements and times what the fluid moved, viscous power
//! in the material by the trapezoidal rule. What is missing in the budget is therefore an error of the step. Contacts sum
//! their own losses in every sub-step.

use crate::beam::{Motion as EndMotion, tangent};
use crate::contact::ContactSystem;
use crate::hydrodynamics::spin;
use crate::points::abscissa;
use crate::{Ambient, FibreSystem, Quaternion, Vector3};
use fibreflow_parallel::block_sums;
use rayon::prelude::*;

/// Energy of all fibres and what has changed it since the first step \[J\]. Supports that move are not counted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Budget {
    /// Change of the kinetic energy.
    pub kinetic: f64,
    /// Change of the elastic energy.
    pub elastic: f64,
    /// Energy stored in contacts.
    pub contact: f64,
    /// Work of weight, buoyancy and point loads.
    pub loads: f64,
    /// Work of walls that move.
    pub walls: f64,
    /// Work of the flow: force on the fibres times velocity of the fluid, torque times its spin.
    pub flow: f64,
    /// What of that is lost between fluid and fibre: force times slip.
    pub drag: f64,
    /// Loss by the material's damping.
    pub material: f64,
    /// Loss by damping, friction and lubrication in contacts.
    pub contact_loss: f64,
}

impl Budget {
    /// What comes in less what is stored or lost \[J\].
    pub fn residual(&self) -> f64 {
        let given = self.loads + self.walls + self.flow;
        given
            - self.drag
            - self.material
            - self.contact_loss
            - (self.kinetic + self.elastic + self.contact)
    }

    /// The largest term \[J\].
    pub fn largest(&self) -> f64 {
        let stored = [self.kinetic, self.elastic, self.contact];
        let lost = [self.drag, self.material, self.contact_loss];
        let given = [self.loads, self.walls, self.flow];
        let all = stored.into_iter().chain(lost).chain(given);
        all.map(f64::abs).fold(0.0, f64::max)
    }
}

/// What has been done on one fibre; part of its record.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Account {
    /// Kinetic and elastic energy before the first step.
    start: Option<[f64; 2]>,
    /// Works of loads and flow, losses in drag and material.
    works: [f64; 4],
    /// Contacts with other fibres at the end of the last step.
    pub contacts: f64,
}

impl Account {
    /// Words of a record.
    pub const WORDS: usize = 8;

    pub(crate) fn is_open(&self) -> bool {
        self.start.is_some()
    }

    pub(crate) fn opened_at(start: Option<[f64; 2]>) -> Self {
        Self {
            start,
            ..Self::default()
        }
    }

    pub fn to_words(self) -> [u64; Self::WORDS] {
        let [kinetic, elastic] = self.start.unwrap_or_default();
        let [a, b, c, d] = self.works;
        let numbers = [kinetic, elastic, a, b, c, d, self.contacts];
        let [kinetic, elastic, a, b, c, d, contacts] = numbers.map(f64::to_bits);
        [
            u64::from(self.start.is_some()),
            kinetic,
            elastic,
            a,
            b,
            c,
            d,
            contacts,
        ]
    }

    pub fn from_words(started: u64, [kinetic, elastic, a, b, c, d, contacts]: [f64; 7]) -> Self {
        Self {
            start: (started != 0).then_some([kinetic, elastic]),
            works: [a, b, c, d],
            contacts,
        }
    }
}

/// All accounts of a rank, and where the nodes were before the step.
#[derive(Clone, Debug, Default)]
pub(crate) struct Accounts {
    /// One a fibre.
    pub fibres: Vec<Account>,
    position: Vec<Vector3>,
    orientation: Vec<Quaternion>,
    /// Viscous power in the material of every fibre \[W\].
    power: Vec<f64>,
}

impl FibreSystem {
    /// Budget of energy over all ranks, if the settings ask for it. Collective.
    pub fn budget(&self) -> Option<Budget> {
        if !self.settings.budget {
            return None;
        }
        let fibres = &self.accounts.fibres;
        let mut sums = block_sums(fibres.len(), |range| {
            let mut sums = [0.0; 6];
            for f in range {
                let account = &fibres[f];
                let now = self.fibre_energy(f);
                let start = account.start.unwrap_or(now);
                let changes = [now[0] - start[0], now[1] - start[1]];
                let all = changes.into_iter().chain(account.works);
                sums.iter_mut()
                    .zip(all)
                    .for_each(|(sum, value)| *sum += value);
            }
            sums
        });
        self.communicator.sum_slice(&mut sums);
        let [kinetic, elastic, loads, flow, drag, material] = sums;
        let contacts = self.contacts().map(ContactSystem::statistics);
        let contacts = contacts.unwrap_or_default();
        let [contact_loss, walls] = self.contact_works();
        Some(Budget {
            kinetic,
            elastic,
            contact: contacts.stored_energy,
            loads,
            walls,
            flow,
            drag,
            material,
            contact_loss,
        })
    }

    /// Loss in contacts and work of walls since the first step of the first run \[J\].
    pub(crate) fn contact_works(&self) -> [f64; 2] {
        let [loss, work, _] = self.contacts().map_or([0.0; 3], ContactSystem::settled);
        [loss, work]
    }

    /// Kinetic and elastic energy of a local fibre \[J\].
    fn fibre_energy(&self, fibre: usize) -> [f64; 2] {
        let m = &self.motion;
        let mut kinetic = 0.0;
        for i in self.model.node_range(fibre) {
            let node = &self.model.nodes[i];
            let w = &m.angular_velocity[i];
            let axial = w.dot(&tangent(&m.orientation[i])).powi(2);
            kinetic += 0.5
                * (node.mass * m.velocity[i].norm_squared()
                    + node.transverse_inertia * (w.norm_squared() - axial)
                    + node.axial_inertia * axial);
        }
        [kinetic, self.elastic_energy(fibre).total()]
    }

    /// Power that is lost in the material of a local fibre \[W\].
    fn viscous_power(&self, fibre: usize) -> f64 {
        let constants = &self.model.fibres[fibre];
        if constants.material.retardation == 0.0 || constants.body.is_some() {
            return 0.0;
        }
        if constants.twist_free {
            return self.chain_viscous_power(fibre);
        }
        let first = self.model.offsets[fibre];
        let motion = |i: usize| EndMotion {
            velocity: &self.motion.velocity[first + i],
            angular_velocity: &self.motion.angular_velocity[first + i],
        };
        let segments = &self.model.segments[self.model.segment_range(fibre)];
        let power = segments.iter().enumerate().map(|(s, segment)| {
            let (start, end) = self.segment_poses(fibre, s);
            let (a, b) = (motion(s), motion(s + 1));
            let f = segment.viscous_force(start, end, a, b);
            -f.force.dot(&(b.velocity - a.velocity))
                - f.start_torque.dot(a.angular_velocity)
                - f.end_torque.dot(b.angular_velocity)
        });
        power.sum()
    }

    /// Remembers where everything is before a step.
    pub(crate) fn open_accounts(&mut self) {
        let mut accounts = std::mem::take(&mut self.accounts);
        accounts.position.clone_from(&self.motion.position);
        accounts.orientation.clone_from(&self.motion.orientation);
        accounts.power.resize(accounts.fibres.len(), 0.0);
        let fibres = accounts.fibres.par_iter_mut().zip(&mut accounts.power);
        fibres.enumerate().for_each(|(f, (account, power))| {
            account.start.get_or_insert_with(|| self.fibre_energy(f));
            *power = self.viscous_power(f);
        });
        self.accounts = accounts;
    }

    /// Adds what the step has done.
    pub(crate) fn close_accounts(&mut self, ambient: Option<&Ambient>, dt: f64) {
        let mut accounts = std::mem::take(&mut self.accounts);
        let Accounts {
            fibres,
            position,
            orientation,
            power,
            ..
        } = &mut accounts;
        let (position, orientation) = (&*position, &*orientation);
        fibres
            .par_iter_mut()
            .zip(power)
            .enumerate()
            .for_each(|(f, (account, power))| {
                let moved = |i: usize| self.motion.position[i] - position[i];
                let turned = |i: usize| {
                    (self.motion.orientation[i] * orientation[i].inverse()).scaled_axis()
                };
                for i in self.model.node_range(f) {
                    let force = self.model.loads[i].force + self.model.nodes[i].weight;
                    account.works[0] +=
                        force.dot(&moved(i)) + self.model.loads[i].torque.dot(&turned(i));
                }
                account.works[3] += 0.5 * (*power + self.viscous_power(f)) * dt;
                let Some(ambient) = ambient else {
                    return;
                };
                for (i, s) in self.model.segment_range(f).enumerate() {
                    let node = self.model.offsets[f] + i;
                    let range = self.model.points[s]..self.model.points[s + 1];
                    let count = range.len();
                    for (k, p) in range.enumerate() {
                        let xi = abscissa(k, count);
                        let between = |a: Vector3, b: Vector3| a * (1.0 - xi) + b * xi;
                        let force = -self.reaction.force[p];
                        let torque = -self.reaction.torque[p];
                        let given = force.dot(&ambient.velocity_at(p, 0.5))
                            + torque.dot(&spin(ambient.gradient_at(p)));
                        let taken = force.dot(&between(moved(node), moved(node + 1)))
                            + torque.dot(&between(turned(node), turned(node + 1)));
                        account.works[1] += given * dt;
                        account.works[2] += given * dt - taken;
                    }
                }
            });
        self.accounts = accounts;
    }
}
