//! Two-way coupling of fluid and fibres: locate, interpolate, spread, exchange.
