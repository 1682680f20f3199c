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
    /// Another rank failed; all ranks stop together.
    #[error("a hydrodynamic point of another rank is not at a finite position")]
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
