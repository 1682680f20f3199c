//! Plane walls that keep linked fibres on one side, without friction, and the piston that presses them together (S 2.11.1).

use super::system::{Chain, Segment};
use super::touch::DEEPEST;
use crate::contact::{Repulsion, Surface, Wall};
use crate::{FibreError, Vector3};

/// A wall that a weight presses against the fibres: M dv/dt = W − ΣF along its normal (S 2.105), until it has travelled so far, where
/// it stays.
///
/// Its speed in a step follows from the forces at the start of the step, so that a step must be short by M over the resistance of all
/// that it pushes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piston {
    /// Index of the wall, a plane without a velocity of its own.
    pub wall: usize,
    /// M \[kg\].
    pub mass: f64,
    /// W, along the wall's normal \[N\].
    pub weight: f64,
    /// How far it goes \[m\].
    pub travel: f64,
}

/// A joint or end of a fibre beside a wall.
#[derive(Clone, Copy, Debug)]
pub(super) struct Press {
    pub segment: u32,
    /// −1 or 1: the segment's first or last end.
    pub end: i8,
    pub wall: u32,
    pub gap: f64,
    /// To the fibres' side.
    pub normal: Vector3,
    /// Force along the normal \[N\].
    pub push: f64,
}

impl Press {
    pub fn key(&self) -> (u32, i8, u32) {
        (self.segment, self.end, self.wall)
    }
}

#[derive(Clone, Copy, Debug)]
struct Plane {
    /// Place along the normal at time 0 \[m\].
    offset: f64,
    normal: Vector3,
    /// Along the normal \[m/s\].
    speed: f64,
}

/// All walls.
#[derive(Clone, Debug, Default)]
pub(super) struct Walls {
    planes: Vec<Plane>,
    piston: Option<Piston>,
    /// What the piston has travelled \[m\], and its speed \[m/s\].
    pub travelled: f64,
    pub speed: f64,
    /// In range at the present positions, in the order of segments, ends and walls.
    pub presses: Vec<Press>,
    /// Those of the last step with the forces that they had.
    pub solved: Vec<Press>,
}

impl Walls {
    /// Of the settings.
    pub fn new(walls: &[Wall], piston: Option<Piston>) -> Result<Self, FibreError> {
        let mut planes = Vec::with_capacity(walls.len());
        for wall in walls {
            let Surface::Plane { point, normal } = &wall.surface else {
                return Err(FibreError::LinkedWall);
            };
            let normal = normal.try_normalize(0.0).ok_or(FibreError::LinkedWall)?;
            let (offset, speed) = (normal.dot(point), normal.dot(&wall.velocity));
            if !(offset.is_finite() && speed.is_finite()) {
                return Err(FibreError::LinkedWall);
            }
            planes.push(Plane {
                offset,
                normal,
                speed,
            });
        }
        if let Some(piston) = &piston {
            let wall = planes.get(piston.wall);
            let positive = |x: f64| x > 0.0 && x.is_finite();
            for (setting, value, good, requirement) in [
                (
                    "wall of the piston",
                    piston.wall as f64,
                    wall.is_some_and(|p| p.speed == 0.0),
                    "one of the walls, without a velocity",
                ),
                (
                    "mass of the piston",
                    piston.mass,
                    positive(piston.mass),
                    "positive",
                ),
                (
                    "weight of the piston",
                    piston.weight,
                    piston.weight.is_finite(),
                    "finite",
                ),
                (
                    "travel of the piston",
                    piston.travel,
                    piston.travel >= 0.0,
                    "zero or positive",
                ),
            ] {
                if !good {
                    return Err(FibreError::Setting {
                        setting,
                        value,
                        requirement,
                    });
                }
            }
        }
        Ok(Self {
            planes,
            piston,
            ..Self::default()
        })
    }

    fn moves(&self, wall: usize) -> Option<&Piston> {
        self.piston.as_ref().filter(|p| p.wall == wall)
    }

    /// Speed of a wall along its normal in a step \[m/s\], given that of the piston.
    pub fn speed_of(&self, wall: u32, piston: f64) -> f64 {
        match self.moves(wall as usize) {
            Some(_) => piston,
            None => self.planes[wall as usize].speed,
        }
    }

    /// All nodes whose gap to a wall is within range, and those farther away by less than `more`.
    pub fn find(
        &mut self,
        chains: &[Chain],
        segments: &[Segment],
        law: Option<&Repulsion>,
        time: f64,
        more: f64,
    ) {
        self.presses.clear();
        let Some(law) = law.filter(|_| !self.planes.is_empty()) else {
            return;
        };
        let bare = Repulsion {
            attraction: 0.0,
            ..*law
        };
        let places: Vec<f64> = (self.planes.iter().enumerate())
            .map(|(w, plane)| {
                let travelled = self.moves(w).map_or(0.0, |_| self.travelled);
                plane.offset + plane.speed * time + travelled
            })
            .collect();
        for s in segments {
            let chain = &chains[s.chain as usize];
            // A joint is the last end of the segment before it.
            let ends: &[i8] = if s.first { &[-1, 1] } else { &[1] };
            for &end in ends {
                let x = s.centre + s.axis * (chain.half_length * f64::from(end));
                for (w, (plane, place)) in self.planes.iter().zip(&places).enumerate() {
                    let gap = plane.normal.dot(&x) - place - chain.radius;
                    if gap >= law.range + more {
                        continue;
                    }
                    let push = if gap < law.range {
                        bare.bare(gap.max(DEEPEST * law.decay))
                    } else {
                        0.0
                    };
                    self.presses.push(Press {
                        segment: s.index,
                        end,
                        wall: w as u32,
                        gap,
                        normal: plane.normal,
                        push,
                    });
                }
            }
        }
    }

    /// Force of the fibres on each wall, against its normal \[N\].
    pub fn loads(&self, presses: &[Press]) -> Vec<f64> {
        let mut loads = vec![0.0; self.planes.len()];
        for press in presses {
            loads[press.wall as usize] += press.push;
        }
        loads
    }

    /// Speed of the piston in a step, pushed back by these presses.
    pub fn next_speed(&self, presses: &[Press], step: f64) -> f64 {
        let Some(piston) = &self.piston else {
            return 0.0;
        };
        let left = piston.travel - self.travelled;
        if left <= 0.0 {
            return 0.0;
        }
        let load = self.loads(presses)[piston.wall];
        let speed = self.speed + step * (piston.weight - load) / piston.mass;
        speed.min(left / step)
    }

    /// Moves the piston, and keeps the presses of the step.
    pub fn advance(&mut self, speed: f64, step: f64) {
        std::mem::swap(&mut self.presses, &mut self.solved);
        let Some(piston) = &self.piston else {
            return;
        };
        self.speed = speed;
        self.travelled += speed * step;
        // It stops where it is to stop, to the last bit.
        if speed > 0.0 && self.travelled >= piston.travel * (1.0 - 1e-14) {
            (self.travelled, self.speed) = (piston.travel, 0.0);
        }
    }
}
