//! What can go wrong when fluid and fibres are coupled.

/// Errors of sampling, spreading and coupled steps.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CouplingError {
    /// A hydrodynamic point is not at a finite position.
    #[error(
        "hydrodynamic point {point} of rank {rank} is at ({}, {}, {}), which is not finite",
        position[0], position[1], position[2]
    )]
    NotFinite {
        /// Index of the point on its rank.
        point: usize,
        /// The rank that owns it.
        rank: usize,
        /// Its position \[m\].
        position: [f64; 3],
    },
    /// A Gaussian that is not positive, or reaches beyond a periodic image.
    #[error(
        "a kernel of width {width} m reaches {reach} m far: that has to be positive and at most the shortest period, {period} m"
    )]
    Width {
        /// σ \[m\].
        width: f64,
        /// Its cut-off \[m\].
        reach: f64,
        /// Distance of the nearest images \[m\].
        period: f64,
    },
    /// The nodes in reach of a point do not determine the kernel.
    #[error(
        "the kernel of width {width} m finds too few nodes around ({}, {}, {}): it has to be wider than the mesh is there",
        position[0], position[1], position[2]
    )]
    Unresolved {
        /// σ \[m\].
        width: f64,
        /// Where \[m\].
        position: [f64; 3],
    },
    /// The disturbance that a fibre makes is known for kernels of a given width only.
    #[error("a kernel that is as wide as the mesh makes a disturbance that depends on the mesh")]
    NoWidth,
    /// Another rank failed; all ranks stop together.
    #[error("the coupling failed on another rank")]
    OtherRank,
    /// Arrays that belong together have different lengths.
    #[error("{what} has length {found}, expected {expected}")]
    Length {
        /// Which array.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The length that fits.
        expected: usize,
    },
}
