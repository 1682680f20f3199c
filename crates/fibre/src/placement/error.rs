//! Why fibres cannot be placed.

/// What can be wrong with a placement.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlacementError {
    /// A setting is out of range.
    #[error("placement: {name} is {value}, but must be {valid}")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What would be valid.
        valid: &'static str,
    },
    /// A direction of no length.
    #[error("placement: the {0} has no direction")]
    Direction(&'static str),
    /// A tensor that is no ⟨pp⟩.
    #[error(
        "placement: the orientation tensor is impossible: {reason}; it is symmetric with trace 1 and no negative eigenvalue"
    )]
    Tensor {
        /// What is wrong.
        reason: &'static str,
    },
    /// A shape that no fibre can have.
    #[error("placement: {reason}")]
    Shape {
        /// What is wrong.
        reason: &'static str,
    },
    /// A fibre would meet its own image whatever its direction.
    #[error(
        "placement: the periodic box is {length} m long along {axis}, but a fibre of radius {radius} m with its gap needs at least {least} m"
    )]
    BoxTooSmall {
        /// x, y or z.
        axis: char,
        /// Length of the box \[m\].
        length: f64,
        /// Radius of the fibres \[m\].
        radius: f64,
        /// What would do \[m\].
        least: f64,
    },
    /// There is no room for all fibres.
    #[error(
        "there is room for {placed} of {wanted} fibres (volume fraction {volume_fraction:.4}); ask for fewer or shorter fibres, or align them"
    )]
    NoRoom {
        /// Fibres placed.
        placed: usize,
        /// Fibres wanted.
        wanted: usize,
        /// Volume fraction reached.
        volume_fraction: f64,
    },
}

pub(super) fn check(
    good: bool,
    name: &'static str,
    value: f64,
    valid: &'static str,
) -> Result<(), PlacementError> {
    if good && value.is_finite() {
        Ok(())
    } else {
        Err(PlacementError::Setting { name, value, valid })
    }
}
