//! Fibres as beams: mechanics, contacts, placement, hydrodynamic laws, ambient flows.
