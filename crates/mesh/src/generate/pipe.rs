//! Pipes of hexahedra: a square core with rounded sides inside rings that are fine at the wall (O-grid).

use super::Stretching;
use crate::{BoundaryFace, ElementKind, Image, Mesh, MeshError, Periods};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, SQRT_2};

/// A circular pipe along x.
///
/// Every section has `core`² cells in the middle and `layers` rings of 4 `core` cells around them,
/// of which those in the outer half of the thickness are circles. Radial lines are straight, so
/// that cells on the wall are orthogonal; nodes lie on the circle, so the volume is that of a prism of 4 `core` sides:
/// L · 2N R² sin(π/2N).
#[derive(Clone, Debug, PartialEq)]
pub struct PipeMesh {
    /// Centre of the section with the smallest x \[m\].
    pub origin: [f64; 3],
    /// R \[m\].
    pub radius: f64,
    /// L \[m\].
    pub length: f64,
    /// Cells along the pipe.
    pub cells: usize,
    /// N, cells across the core.
    pub core: usize,
    /// Rings between core and wall.
    pub layers: usize,
    /// Radius of the corners of the core, by R: above 0, below 1.
    pub core_radius: f64,
    /// 0: the core has straight sides; 1: it is a circle (and its corners are flat, which is not allowed).
    pub roundness: f64,
    /// Thickness of the rings from the core outwards: [`Stretching::Tanh`] is fine at the wall only.
    pub stretching: Stretching,
    /// Periodic along x; otherwise the ends are the patches `x_min` and `x_max`. The wall is `wall`.
    pub periodic: bool,
}

impl Default for PipeMesh {
    fn default() -> Self {
        Self {
            origin: [0.0; 3],
            radius: 0.5,
            length: 1.0,
            cells: 1,
            core: 4,
            layers: 4,
            core_radius: 0.5,
            roundness: 0.5,
            stretching: Stretching::Uniform,
            periodic: true,
        }
    }
}

impl PipeMesh {
    /// The mesh: section by section, in each the core row by row, then the rings outwards.
    ///
    /// # Errors
    /// [`MeshError::Parameter`] for values out of range, [`MeshError::Size`] for more nodes than 32 bits count.
    pub fn build(&self) -> Result<Mesh, MeshError> {
        self.check()?;
        let section = self.section()?;
        let (quads, of_section) = (self.quads(), section.len());
        let planes = self.cells + usize::from(!self.periodic);
        let mut mesh = Mesh {
            patches: vec!["wall".into()],
            ..Mesh::default()
        };
        for i in 0..planes {
            let x = self.origin[0] + self.length * i as f64 / self.cells as f64;
            let place = |&[y, z]: &[f64; 2]| [x, self.origin[1] + y, self.origin[2] + z];
            mesh.nodes.extend(section.iter().map(place));
        }
        let at = |plane: usize, node: usize| {
            let round = plane / planes;
            let image = Image::new([round as i8, 0, 0]);
            ((of_section * (plane % planes) + node) as u32, image)
        };
        for i in 0..self.cells {
            for quad in &quads {
                let vertex = |k: usize| at(i + k / 4, quad[k % 4]);
                let vertices: [(u32, Image); 8] = std::array::from_fn(vertex);
                let (nodes, images) = (vertices.map(|v| v.0), vertices.map(|v| v.1));
                mesh.elements.push(ElementKind::Hexahedron, &nodes, &images);
            }
        }
        let mut face = |patch, vertices: [(u32, Image); 4]| {
            mesh.boundary.push(BoundaryFace {
                patch,
                vertices: 4,
                nodes: vertices.map(|v| v.0),
                images: vertices.map(|v| v.1),
            });
        };
        for i in 0..self.cells {
            for k in 0..4 * self.core {
                let (a, b) = (self.ring(self.layers, k), self.ring(self.layers, k + 1));
                face(0, [at(i, a), at(i, b), at(i + 1, b), at(i + 1, a)]);
            }
        }
        if self.periodic {
            mesh.periods = Periods {
                vectors: [[self.length, 0.0, 0.0], [0.0; 3], [0.0; 3]],
            };
        } else {
            for &[a, b, c, d] in &quads {
                face(1, [at(0, a), at(0, d), at(0, c), at(0, b)]);
                face(2, [a, b, c, d].map(|node| at(self.cells, node)));
            }
            mesh.patches.extend(["x_min".into(), "x_max".into()]);
        }
        Ok(mesh)
    }

    fn check(&self) -> Result<(), MeshError> {
        let positive = |x: f64| x.is_finite() && x > 0.0;
        let inside = |x: f64| x > 0.0 && x < 1.0;
        let problems = [
            ("radius", self.radius, positive(self.radius), "positive [m]"),
            ("length", self.length, positive(self.length), "positive [m]"),
            (
                "core_radius",
                self.core_radius,
                inside(self.core_radius),
                "above 0 and below 1",
            ),
            (
                "roundness",
                self.roundness,
                (0.0..1.0).contains(&self.roundness),
                "0 to below 1",
            ),
        ];
        let counts = [
            ("cells", self.cells),
            ("core", self.core),
            ("layers", self.layers),
        ];
        let counts = counts.map(|(name, n)| (name, n as f64, n > 0, "at least 1"));
        let origin = self.origin.into_iter().find(|o| !o.is_finite());
        let origin = origin.map(|o| ("origin", o, false, "finite coordinates"));
        let mut all = problems.into_iter().chain(counts).chain(origin);
        if let Some((name, value, _, expected)) = all.find(|problem| !problem.2) {
            return Err(MeshError::Parameter {
                name,
                value: value.to_string(),
                expected: expected.into(),
            });
        }
        let (n, m) = (self.core as u128, self.layers as u128);
        let vertices = 8 * self.cells as u128 * (n * n + 4 * n * m);
        if vertices > u128::from(u32::MAX) {
            return Err(MeshError::Size(format!(
                "a pipe of {} sections of {n}² + 4·{n}·{m} cells has more vertices than 32 bits count",
                self.cells
            )));
        }
        Ok(())
    }

    /// Nodes of a section (y, z) about its centre \[m\].
    fn section(&self) -> Result<Vec<[f64; 2]>, MeshError> {
        let n = self.core as f64;
        let mut nodes = Vec::new();
        for j in 0..=self.core {
            for i in 0..=self.core {
                let [xi, eta] = [i, j].map(|k| 2.0 * k as f64 / n - 1.0);
                nodes.push(self.core_point(xi, eta));
            }
        }
        let rings = self.rings();
        if !self.stretching.is_valid() || !rings.windows(2).all(|w| w[0] < w[1]) {
            return Err(MeshError::Parameter {
                name: "stretching",
                value: format!("{:?}", self.stretching),
                expected:
                    "a positive tanh parameter or ratio that leaves rings of positive thickness"
                        .into(),
            });
        }
        let core = self.core_radius * self.radius;
        for &s in &rings[1..] {
            for k in 0..4 * self.core {
                let (angle, inner) = self.side(k);
                let circle = core + s * (self.radius - core);
                let left = (1.0 - 2.0 * s).max(0.0);
                let r = if s == 1.0 {
                    self.radius
                } else {
                    circle + left * left * (inner - core)
                };
                nodes.push([r * angle.cos(), r * angle.sin()]);
            }
        }
        Ok(nodes)
    }

    /// Places of the rings between core (0) and wall (1).
    fn rings(&self) -> Vec<f64> {
        match self.stretching {
            Stretching::Tanh(_) => {
                let both = self.stretching.planes(2 * self.layers);
                both[self.layers..].iter().map(|s| 2.0 * s - 1.0).collect()
            }
            _ => self.stretching.planes(self.layers),
        }
    }

    /// Half the edge of the square through the corners of the core \[m\].
    fn half(&self) -> f64 {
        self.core_radius * self.radius / SQRT_2
    }

    /// Radius of the rounded side of the core at −π/4…π/4 from its middle \[m\].
    fn side_radius(&self, angle: f64) -> f64 {
        let circle = self.core_radius * self.radius;
        (1.0 - self.roundness) * self.half() / angle.cos() + self.roundness * circle
    }

    /// Angle of radial line k and the radius of the core there \[m\].
    fn side(&self, k: usize) -> (f64, f64) {
        let k = k % (4 * self.core);
        let along = 2.0 * (k % self.core) as f64 / self.core as f64 - 1.0;
        let angle = FRAC_PI_4 * along;
        (
            angle + FRAC_PI_2 * (k / self.core) as f64,
            self.side_radius(angle),
        )
    }

    /// A point of the core, ξ, η = −1…1, between its four sides (transfinite interpolation, Gordon & Hall 1973).
    fn core_point(&self, xi: f64, eta: f64) -> [f64; 2] {
        // Distance of a side from the centre, and along it, at −1…1.
        let side = |s: f64| {
            let (r, angle) = (self.side_radius(FRAC_PI_4 * s), FRAC_PI_4 * s);
            [r * angle.cos(), r * angle.sin()]
        };
        let ([out_y, along_z], [out_z, along_y]) = (side(eta), side(xi));
        let corner = self.half();
        [
            xi * (out_y - corner) + along_y,
            eta * (out_z - corner) + along_z,
        ]
    }

    /// Node k (counter-clockwise from the corner at −π/4) of ring `layer` of a section; ring 0 is the side of the core.
    fn ring(&self, layer: usize, k: usize) -> usize {
        let n = self.core;
        let (k, row) = (k % (4 * n), n + 1);
        if layer > 0 {
            return row * row + 4 * n * (layer - 1) + k;
        }
        let at = k % n;
        match k / n {
            0 => n + row * at,
            1 => (n - at) + row * n,
            2 => row * (n - at),
            _ => at,
        }
    }

    /// Quadrilaterals of a section, counter-clockwise seen against x.
    fn quads(&self) -> Vec<[usize; 4]> {
        let (n, row) = (self.core, self.core + 1);
        let mut quads = Vec::with_capacity(n * n + 4 * n * self.layers);
        for j in 0..n {
            for i in 0..n {
                let low = i + row * j;
                quads.push([low, low + 1, low + row + 1, low + row]);
            }
        }
        for layer in 0..self.layers {
            for k in 0..4 * n {
                let [inner, outer] = [layer, layer + 1];
                quads.push([
                    self.ring(inner, k),
                    self.ring(outer, k),
                    self.ring(outer, k + 1),
                    self.ring(inner, k + 1),
                ]);
            }
        }
        quads
    }
}
