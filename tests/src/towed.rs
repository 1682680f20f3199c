//! A single segment towed through a fluid at rest: its drag against the law, whatever the mesh (validation row C5).
//!
//! Lengths by the width σ of the Gaussian kernel, velocities by that of the segment, viscosity 1.

use fibreflow_coupling::{Anderson, Coupling, Kernel, PlaneWall, Undisturbed, Wake};
use fibreflow_fibre::hydrodynamics::{DragModel, FluidProperties, Section, TorqueModel};
use fibreflow_fibre::{
    Ambient, Fibre, FibreSettings, FibreSystem, Hydrodynamics, Material, Points, Support,
};
use fibreflow_fluid::{BoundaryCondition, Fluid, FluidSettings, Inertia};
use fibreflow_mesh::{BoxElement, BoxMesh, distribute, geometry};
use fibreflow_parallel::Communicator;
use nalgebra::Vector3;
use std::error::Error;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

type V3 = Vector3<f64>;

/// Edge of the box.
pub const BOX: f64 = 12.0;
/// Length of the segment.
pub const LENGTH: f64 = 2.0;
/// Its diameter.
pub const DIAMETER: f64 = 0.2;
/// Variance of the Gaussian as it is cut off.
const VARIANCE: f64 = 0.994_284;

/// What is towed through what.
#[derive(Clone, Copy, Debug)]
pub struct Tow {
    /// Kind of the elements.
    pub element: BoxElement,
    /// Elements along each edge.
    pub cells: usize,
    /// Reynolds number of the diameter; steady creeping flow below 0.02.
    pub reynolds: f64,
    /// Walls at y = 0 and y = [`BOX`], otherwise periodic.
    pub walls: bool,
    /// How points and nodes see each other.
    pub kernel: Kernel,
    /// The segment feels the flow without what it makes of it.
    pub corrected: bool,
    /// Middle of the segment.
    pub middle: V3,
    /// Unit vectors along the segment and its velocity.
    pub directions: [V3; 2],
}

/// Drag against the law.
#[derive(Clone, Copy, Debug)]
pub struct Towed {
    /// |F − F_law|/|F_law|, the largest in the second half of the tow.
    pub error: f64,
    /// F·F_law/|F_law|² − 1 at the end.
    pub excess: f64,
    /// Velocity by which periodic images and the mean flow change the slip of the law.
    pub images: f64,
}

/// A fluid that many segments are towed through.
pub struct Basin {
    fluid: Fluid,
    tow: Tow,
    density: f64,
}

impl Basin {
    /// For this and other tows of the same mesh, Reynolds number and walls.
    ///
    /// # Errors
    /// What the parts report.
    pub fn new(tow: &Tow) -> Result<Self, Box<dyn Error>> {
        // Far-field of a force beside a wall falls with the cube of the distance: images twice as far do not matter.
        let (along, times) = if tow.walls { (2.0 * BOX, 2) } else { (BOX, 1) };
        let mesh = BoxMesh {
            size: [along, BOX, along],
            cells: [times * tow.cells, tow.cells, times * tow.cells],
            periodic: [true, !tow.walls, true],
            element: tow.element,
            ..BoxMesh::default()
        };
        let mesh = Arc::new(distribute(&Communicator::single(), Some(mesh.build()?))?);
        let geometry = Arc::new(geometry::dual(&mesh)?);
        let density = tow.reynolds / DIAMETER;
        let mut settings = FluidSettings::new(density, 1.0);
        settings.boundary = vec![BoundaryCondition::WALL; mesh.patches.len()];
        settings.pressure.relative_tolerance = 1e-6;
        if tow.reynolds < 0.02 {
            settings.inertia = Inertia::Steady;
        }
        Ok(Self {
            fluid: Fluid::new(mesh, geometry, settings)?,
            tow: *tow,
            density,
        })
    }

    fn steady(&self) -> bool {
        self.fluid.settings().inertia == Inertia::Steady
    }

    /// Tows one segment: 4 σ far, or for 4 σ²/ν where that is shorter.
    ///
    /// # Errors
    /// What the parts report.
    pub fn tow(&mut self, tow: &Tow) -> Result<Towed, Box<dyn Error>> {
        debug_assert!(tow.cells == self.tow.cells && tow.reynolds == self.tow.reynolds);
        let (mesh, geometry) = (self.fluid.mesh().clone(), self.fluid.geometry().clone());
        let mut no_slip = vec![false; mesh.owned()];
        for share in &geometry.boundary {
            no_slip[share.node as usize] = true;
        }
        let mut coupling = Coupling::with_kernel(mesh, geometry, no_slip, tow.kernel)?;
        let wake = if self.steady() {
            Wake::Steady
        } else {
            Wake::Carried
        };
        let undisturbed = if tow.corrected {
            let walls = if tow.walls { walls() } else { Vec::new() };
            let made = Undisturbed::new(tow.kernel, 1.0, self.density, wake, walls)?;
            Some(made)
        } else {
            None
        };
        let mut fibres = self.fibres(tow)?;
        fibres.carry(undisturbed.as_ref().map_or(0, Undisturbed::carried));
        let (dt, steps) = if self.steady() {
            (1e-9, 12)
        } else {
            let h = BOX / tow.cells as f64;
            let dt = (0.3 * h).min(0.2 * h * h * self.density);
            let time = 4.0_f64.min(4.0 * self.density);
            let steps = (time / dt).ceil();
            (time / steps, steps as usize)
        };
        self.fluid.set_velocity(|_| [0.0; 3])?;
        let (mut points, mut ambient) = (Points::default(), Ambient::default());
        let (mut forces, mut solver) = (vec![0.0; 6], Anderson::new(10));
        let (mut error, mut last) = (0.0_f64, None);
        for step in 1..=steps {
            fibres.points(&mut points);
            coupling.sample(self.fluid.velocity(), &points.position, &mut ambient)?;
            if let Some(undisturbed) = &undisturbed {
                let carried = fibres.carried();
                undisturbed.correct(&fibres.point_offsets(), &points, carried, &mut ambient);
            }
            let reaction = fibres.advance(&ambient, dt)?;
            let drag = -reaction.force.iter().sum::<V3>();
            let mut given = reaction.clone();
            if self.steady() {
                // Forces that lag may grow.
                let taken: Vec<f64> = given.force.iter().flat_map(|f| [f.x, f.y, f.z]).collect();
                let squares = taken.iter().zip(&forces).map(|(a, b)| (a - b) * (a - b));
                // Beyond that it is the noise of the solves.
                if squares.sum::<f64>().sqrt() > 1e-5 * drag.norm() {
                    solver.advance(&mut forces, &taken, &Communicator::single());
                }
                let entries = forces.chunks_exact(3).map(Vector3::from_column_slice);
                given.force = entries.collect();
            }
            self.fluid.body_force_mut().fill([0.0; 4]);
            coupling.spread(&given, self.fluid.body_force_mut())?;
            if let Some(undisturbed) = &undisturbed {
                let carried = fibres.carried_mut().0;
                undisturbed.remember(carried, &points, &ambient, &given, dt);
            }
            self.fluid.advance(dt)?;
            let settled = if self.steady() {
                step == steps
            } else {
                2 * step > steps
            };
            if settled {
                let elapsed = (step - 1) as f64 * dt;
                let (law, images) = self.law(tow, &drag, elapsed);
                error = error.max((drag - law).norm() / law.norm());
                last = Some((drag.dot(&law) / law.norm_squared() - 1.0, images.norm()));
            }
        }
        let (excess, images) = last.ok_or("no step")?;
        Ok(Towed {
            error,
            excess,
            images,
        })
    }

    fn fibres(&self, tow: &Tow) -> Result<FibreSystem, Box<dyn Error>> {
        let [along, velocity] = tow.directions;
        let half = 0.5 * LENGTH * along;
        let material = Material::new(0.5 * DIAMETER, 1.0, 0.3, self.density);
        let mut fibre = Fibre::straight(0, material, tow.middle - half, tow.middle + half, 1);
        fibre.supports = vec![Support::clamp(0), Support::clamp(1)];
        let settings = FibreSettings {
            hydrodynamics: Some(Hydrodynamics {
                fluid: FluidProperties {
                    density: self.density,
                    viscosity: 1.0,
                },
                drag: DragModel::default(),
                torque: TorqueModel::None,
                point_spacing: f64::INFINITY,
            }),
            ..FibreSettings::default()
        };
        let mut fibres = FibreSystem::new(Communicator::single(), settings, vec![fibre])?;
        fibres.velocities_mut().fill(velocity);
        Ok(fibres)
    }

    /// Drag of the law in the flow of the periodic images, and that flow.
    fn law(&self, tow: &Tow, drag: &V3, elapsed: f64) -> (V3, V3) {
        let [along, velocity] = tow.directions;
        let images = match (tow.walls, self.steady()) {
            (true, _) => V3::zeros(),
            (false, true) => {
                let free = -drag / (6.0 * PI * (PI * VARIANCE).sqrt());
                lattice(BOX, |k| 1.0 / k.norm_squared(), drag) - free
            }
            (false, false) => {
                let answer = |k: &V3| {
                    let (decay, turn) = (k.norm_squared() / self.density, k.dot(&velocity));
                    // Re of (1 − exp(−at))/a, a = νk² + i k·U.
                    let (fade, phase) = ((-decay * elapsed).exp(), turn * elapsed);
                    let parts = [1.0 - fade * phase.cos(), fade * phase.sin()];
                    let size = decay * decay + turn * turn;
                    (parts[0] * decay + parts[1] * turn) / (size * self.density)
                };
                let mean = -drag * elapsed / (self.density * BOX.powi(3));
                let mean_far = -drag * elapsed / (self.density * (5.0 * BOX).powi(3));
                let far = lattice(5.0 * BOX, answer, drag) + mean_far;
                lattice(BOX, answer, drag) + mean - far
            }
        };
        let section = Section::middle(DIAMETER, LENGTH);
        let properties = FluidProperties {
            density: self.density,
            viscosity: 1.0,
        };
        let slip = images - velocity;
        let resistance = DragModel::default().resistance(&along, &slip, &section, &properties);
        (LENGTH * resistance.force(&along, &slip), images)
    }
}

/// Σ exp(−σ²k²) (I − kk/k²) a(k) F/L³ over the waves of a box, F = −drag on the fluid.
fn lattice(edge: f64, answer: impl Fn(&V3) -> f64, drag: &V3) -> V3 {
    let most = (5.0 * edge / TAU).ceil() as i32;
    let mut sum = V3::zeros();
    for i in -most..=most {
        for j in -most..=most {
            for n in -most..=most {
                let k = TAU / edge * Vector3::new(f64::from(i), f64::from(j), f64::from(n));
                let square = k.norm_squared();
                if square == 0.0 || square > 25.0 {
                    continue;
                }
                let across = drag - k * (k.dot(drag) / square);
                sum -= across * (answer(&k) * (-VARIANCE * square).exp());
            }
        }
    }
    sum / edge.powi(3)
}

fn walls() -> Vec<PlaneWall> {
    let wall = |sign: f64, offset: f64| PlaneWall {
        normal: sign * V3::y(),
        offset,
    };
    vec![wall(1.0, 0.0), wall(-1.0, -BOX)]
}
