//! Fibres as chains of rigid spherocylinders with joints (Switzer 2002, chapter 2; S in what follows).
//!
//! Segments have no inertia. Each one is a prolate spheroid to the flow, joints hold by constraint forces and resist bending
//! and twist by torques, and contacts repel and rub: friction is a constraint, no sliding in the plane of contact until
//! Coulomb's limit. [`LinkedSystem`] advances all fibres by scheme A of S 2.9.2: friction by groups of segments that touch,
//! with the joint forces of the step before, then the joint forces fibre by fibre; or by scheme B, all together and implicit.

mod cone;
mod fibre;
mod friction;
mod grips;
mod groups;
mod implicit;
mod joints;
mod limits;
mod mobility;
mod newton;
mod observe;
mod pins;
mod sampled;
mod settings;
mod state;
mod step;
mod structure;
mod system;
mod touch;
mod walls;

pub use fibre::{Joint, LinkedFibre};
pub use grips::{Grip, Grips};
pub use observe::LinkedStatistics;
pub use settings::{LinkedScheme, LinkedSettings};
pub use structure::ContactLoads;
pub use system::LinkedSystem;
pub use touch::Touch;
pub use walls::Piston;
