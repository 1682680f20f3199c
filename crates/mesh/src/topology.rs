//! A whole mesh: nodes, mixed elements, periodic images, named boundary patches.

/// Element types; local vertex order is VTK's (cell types 10, 14, 13, 12).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u8)]
pub enum ElementKind {
    /// Four vertices, linear.
    Tetrahedron,
    /// Five vertices: quadrilateral base 0–3, apex 4; rational shape functions.
    Pyramid,
    /// Six vertices: triangles 0–2 and 3–5 (VTK wedge).
    Prism,
    /// Eight vertices, trilinear.
    Hexahedron,
}

impl ElementKind {
    /// All kinds.
    pub const ALL: [Self; 4] = [
        Self::Tetrahedron,
        Self::Pyramid,
        Self::Prism,
        Self::Hexahedron,
    ];

    /// Number of vertices: 4, 5, 6, 8.
    pub fn vertices(self) -> usize {
        match self {
            Self::Tetrahedron => 4,
            Self::Pyramid => 5,
            Self::Prism => 6,
            Self::Hexahedron => 8,
        }
    }

    /// VTK cell type number.
    pub fn vtk_type(self) -> u8 {
        match self {
            Self::Tetrahedron => 10,
            Self::Pyramid => 14,
            Self::Prism => 13,
            Self::Hexahedron => 12,
        }
    }

    /// Name used in case files and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tetrahedron => "tetrahedron",
            Self::Pyramid => "pyramid",
            Self::Prism => "prism",
            Self::Hexahedron => "hexahedron",
        }
    }

    /// Faces as local vertex lists, ordered so that the normal (right hand) points out of the element.
    pub fn faces(self) -> &'static [&'static [usize]] {
        match self {
            Self::Tetrahedron => &[&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[0, 3, 2]],
            Self::Pyramid => &[
                &[0, 3, 2, 1],
                &[0, 1, 4],
                &[1, 2, 4],
                &[2, 3, 4],
                &[3, 0, 4],
            ],
            // As Gmsh and meshio order it: the normal of 0-1-2 points towards 3-4-5.
            Self::Prism => &[
                &[0, 2, 1],
                &[3, 4, 5],
                &[0, 1, 4, 3],
                &[1, 2, 5, 4],
                &[2, 0, 3, 5],
            ],
            Self::Hexahedron => &[
                &[0, 3, 2, 1],
                &[4, 5, 6, 7],
                &[0, 1, 5, 4],
                &[1, 2, 6, 5],
                &[2, 3, 7, 6],
                &[3, 0, 4, 7],
            ],
        }
    }
}

/// Which periodic copy of a node a vertex means: integer multiples of the lattice vectors, each −1, 0 or 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Image(u8);

impl Image {
    /// The node itself.
    pub const ZERO: Self = Self(13);

    /// From multiples of the three lattice vectors, each −1, 0 or 1.
    ///
    /// # Panics
    /// Panics when a multiple is out of range.
    pub fn new(shifts: [i8; 3]) -> Self {
        assert!(
            shifts.iter().all(|s| (-1..=1).contains(s)),
            "image shift out of range: {shifts:?}"
        );
        let digit = |axis: usize| (shifts[axis] + 1) as u8;
        Self(digit(0) + 3 * digit(1) + 9 * digit(2))
    }

    /// Multiples of the three lattice vectors.
    pub fn shifts(self) -> [i8; 3] {
        [
            (self.0 % 3) as i8 - 1,
            (self.0 / 3 % 3) as i8 - 1,
            (self.0 / 9) as i8 - 1,
        ]
    }

    /// The image of j seen from an image of i: `other − self`. None when it leaves −1…1.
    pub fn to(self, other: Self) -> Option<Self> {
        let (a, b) = (self.shifts(), other.shifts());
        let difference = std::array::from_fn(|k| b[k] - a[k]);
        difference
            .iter()
            .all(|d| (-1..=1).contains(d))
            .then(|| Self::new(difference))
    }

    /// The opposite shift.
    pub fn opposite(self) -> Self {
        Self::new(self.shifts().map(|s| -s))
    }

    /// Code 0…26, for storage.
    pub fn code(self) -> u8 {
        self.0
    }

    /// From a stored code; None above 26.
    pub fn from_code(code: u8) -> Option<Self> {
        (code < 27).then_some(Self(code))
    }
}

/// Lattice vectors of the periodic directions \[m\]; unused ones are zero.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Periods {
    /// Translation vectors; a zero vector means not periodic.
    pub vectors: [[f64; 3]; 3],
}

impl Periods {
    /// Translation of an image \[m\].
    pub fn shift(&self, image: Image) -> [f64; 3] {
        let s = image.shifts();
        std::array::from_fn(|c| (0..3).map(|k| f64::from(s[k]) * self.vectors[k][c]).sum())
    }

    /// True for a lattice vector that is in use.
    pub fn is_periodic(&self, direction: usize) -> bool {
        self.vectors[direction] != [0.0; 3]
    }
}

/// Mixed elements in compressed form.
#[derive(Clone, Debug, Default)]
pub struct Elements {
    /// Kind of every element.
    pub kinds: Vec<ElementKind>,
    /// Start of every element's vertices; length elements + 1 (a lone 0 when empty).
    pub offsets: Vec<u32>,
    /// Node of every vertex.
    pub nodes: Vec<u32>,
    /// Periodic image of every vertex.
    pub images: Vec<Image>,
}

impl Elements {
    /// Number of elements.
    pub fn len(&self) -> usize {
        self.kinds.len()
    }

    /// True without elements.
    pub fn is_empty(&self) -> bool {
        self.kinds.is_empty()
    }

    /// Nodes of element `e`.
    pub fn nodes(&self, e: usize) -> &[u32] {
        &self.nodes[self.offsets[e] as usize..self.offsets[e + 1] as usize]
    }

    /// Images of the vertices of element `e`.
    pub fn images(&self, e: usize) -> &[Image] {
        &self.images[self.offsets[e] as usize..self.offsets[e + 1] as usize]
    }

    /// Appends an element.
    ///
    /// # Panics
    /// Panics when the number of vertices is not the kind's.
    pub fn push(&mut self, kind: ElementKind, nodes: &[u32], images: &[Image]) {
        assert_eq!(
            (nodes.len(), images.len()),
            (kind.vertices(), kind.vertices())
        );
        if self.offsets.is_empty() {
            self.offsets.push(0);
        }
        self.kinds.push(kind);
        self.nodes.extend_from_slice(nodes);
        self.images.extend_from_slice(images);
        self.offsets.push(self.nodes.len() as u32);
    }

    /// Physical vertex coordinates of element `e` \[m\], periodic shifts applied; the first `kind.vertices()` are set.
    pub fn coordinates(&self, e: usize, nodes: &[[f64; 3]], periods: &Periods) -> [[f64; 3]; 8] {
        let mut x = [[0.0; 3]; 8];
        for (v, (&node, &image)) in self.nodes(e).iter().zip(self.images(e)).enumerate() {
            let shift = if image == Image::ZERO {
                [0.0; 3]
            } else {
                periods.shift(image)
            };
            x[v] = std::array::from_fn(|c| nodes[node as usize][c] + shift[c]);
        }
        x
    }
}

/// A triangle or quadrilateral on the boundary, normal pointing out of the domain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundaryFace {
    /// Index into the patch names.
    pub patch: u16,
    /// 3 or 4.
    pub vertices: u8,
    /// Nodes; the last one is unused on a triangle.
    pub nodes: [u32; 4],
    /// Periodic images of the vertices.
    pub images: [Image; 4],
}

/// A whole mesh. Periodic copies of a node are one node; vertices carry the image.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Node coordinates \[m\].
    pub nodes: Vec<[f64; 3]>,
    /// Elements.
    pub elements: Elements,
    /// Boundary faces of all patches.
    pub boundary: Vec<BoundaryFace>,
    /// Patch names.
    pub patches: Vec<String>,
    /// Periodic directions.
    pub periods: Periods,
}
