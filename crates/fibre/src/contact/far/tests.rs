use super::*;

fn repulsion() -> Repulsion {
    Repulsion {
        strength: 3.0,
        decay: 0.05,
        attraction: 0.2,
        attraction_width: 0.17,
        range: 0.33,
        contact_gap: 0.1,
    }
}

fn adhesion() -> VanDerWaals {
    VanDerWaals {
        hamaker: 2.0,
        closest: 0.01,
        range: 0.5,
    }
}

fn facing(angle: f64, offset: f64) -> Facing {
    let a = [Vector3::zeros(), Vector3::new(8.0, 0.0, 0.0)];
    let q = 5.0 * Vector3::new(angle.cos(), angle.sin(), 0.0);
    let start = Vector3::new(offset, 0.0, 2.0);
    Facing::axes(&a, &[start, start + q], [1.0, 0.7])
}

/// The force is minus the slope of the energy, the energy ends at the range, and the force is continuous there.
fn follows_from_energy(push: impl Fn(f64) -> Push, range: f64) {
    let step = 1e-6;
    for k in -20..100 {
        let h = range * (f64::from(k) / 100.0 + 0.003);
        let slope = (push(h + step).energy - push(h - step).energy) / (2.0 * step);
        let force = push(h).force;
        let tolerance = 1e-7 * (1.0 + force.abs() / step.sqrt() * 1e-2);
        assert!((force + slope).abs() < tolerance, "{h}: {force} {slope}");
        let stiffer = (push(h + step).force - push(h - step).force) / (-2.0 * step);
        assert!(stiffer < push(h).stiffness * (1.0 + 1e-6), "{h}: {stiffer}");
    }
    let end = push(range * (1.0 - 1e-9));
    let start = push(0.0);
    assert!(end.energy.abs() < 1e-8 * start.energy.abs());
    assert!(end.force.abs() < 1e-6 * start.force.abs());
}

#[test]
fn forces_are_the_slopes_of_their_energies() {
    let pure = Repulsion {
        attraction: 0.0,
        ..repulsion()
    };
    follows_from_energy(|h| repulsion().push(h), repulsion().range);
    follows_from_energy(|h| pure.push(h), pure.range);
    for (angle, offset) in [(1.2, 2.0), (0.0, 2.0), (0.0, 7.999)] {
        let facing = facing(angle, offset);
        follows_from_energy(|h| adhesion().push(h, &facing).0, adhesion().range);
    }
}

#[test]
fn the_attraction_has_switzers_form() {
    let r = Repulsion {
        range: 10.0,
        ..repulsion()
    };
    let h: f64 = 0.12;
    let expected = 3.0 * (-h / 0.05).exp() - 0.2 * (-(h / 0.17).powi(2)).exp();
    assert!((r.push(h).force - expected).abs() < 1e-14);
}

#[test]
fn van_der_waals_of_crossed_and_parallel_cylinders() {
    let far = VanDerWaals {
        range: 1e6,
        ..adhesion()
    };
    let (h, r1, r2) = (0.1, 1.0, 0.7_f64);
    let crossed = far.push(h, &facing(0.9, 2.0)).0;
    let expected = -2.0 * r2.sqrt() / (6.0 * h * h * 0.9_f64.sin());
    assert!((crossed.force / expected - 1.0).abs() < 1e-10);
    let side = far.push(h, &facing(0.0, 5.0)).0;
    let reduced: f64 = r1 * r2 / (r1 + r2);
    let expected = -2.0 * 3.0 * reduced.sqrt() / (8.0 * SQRT_2 * h.powf(2.5));
    assert!((side.force / expected - 1.0).abs() < 1e-10);
    let ends = far.push(h, &facing(0.0, 8.0)).0;
    assert!((ends.force / (-2.0 * reduced / (6.0 * h * h)) - 1.0).abs() < 1e-10);
}

/// The torque is minus the slope of the energy by the angle, and turns the axes together.
#[test]
fn van_der_waals_turns_crossed_cylinders_towards_each_other() {
    for angle in [0.8, 1.4, 2.0, -0.9] {
        let energy = |angle: f64| adhesion().push(0.1, &facing(angle, 2.0)).0.energy;
        let slope = (energy(angle + 1e-6) - energy(angle - 1e-6)) / 2e-6;
        // The torque on the second body is the opposite of that on the first.
        let torque = -adhesion().push(0.1, &facing(angle, 2.0)).1.z;
        assert!(
            (torque + slope).abs() < 1e-7 * slope.abs().max(1.0),
            "{torque} {slope}"
        );
    }
}

fn lubrication(model: LubricationModel) -> Lubrication {
    Lubrication {
        viscosity: 0.3,
        roughness: 1e-3,
        range: 1e6,
        model,
    }
}

/// Pressure between two paraboloids with gap h + x²/2R₁ + y²/2R₂ that approach at unit speed, by quadrature of the exact
/// solution p = 6μ/(1/R₁ + 1/R₂)/H² of Reynolds' equation; R₂ infinite: per unit length.
#[test]
fn lubrication_of_crossed_and_parallel_cylinders() {
    let mu = 0.3;
    let film = lubrication(LubricationModel::Cylinders);
    let h: f64 = 0.02;
    // Crossed at θ, equal radii r: principal radii r/(1 ± cos θ).
    let angle: f64 = 0.9;
    let mut equal = facing(angle, 2.0);
    equal.radii = [0.8; 2];
    let radii = [0.8 / (1.0 + angle.cos()), 0.8 / (1.0 - angle.cos())];
    let curvature = 1.0 / radii[0] + 1.0 / radii[1];
    let mut force = 0.0;
    // Elliptic rings: x = √(2R₁h) ρ cos φ …, dA = 2h√(R₁R₂) ρ dρ dφ, with ρ = u/(1 − u).
    let n = 20_000;
    for k in 0..n {
        let u = (f64::from(k) + 0.5) / f64::from(n);
        let rho = u / (1.0 - u);
        let height = h * (1.0 + rho * rho);
        let ring = 2.0 * h * (radii[0] * radii[1]).sqrt() * 2.0 * PI * rho;
        let width = 1.0 / ((1.0 - u) * (1.0 - u)) / f64::from(n);
        force += 6.0 * mu / (curvature * height * height) * ring * width;
    }
    let found = film.resistance(h, &equal).normal;
    assert!((found / force - 1.0).abs() < 1e-6, "{found} {force}");

    // Side by side over 3.
    let side = facing(0.0, 5.0);
    let reduced = 0.7 / 1.7;
    let mut line = 0.0;
    for k in 0..n {
        let u = (f64::from(k) + 0.5) / f64::from(n);
        let rho = u / (1.0 - u);
        let height = h * (1.0 + rho * rho);
        let width = (2.0 * reduced * h).sqrt() / ((1.0 - u) * (1.0 - u)) / f64::from(n);
        line += 2.0 * 6.0 * mu * reduced / (height * height) * width;
    }
    let found = film.resistance(h, &side).normal;
    assert!((found / (3.0 * line) - 1.0).abs() < 1e-6, "{found} {line}");
}

#[test]
fn lubrication_with_kunhappans_constants_and_cut_offs() {
    let film = lubrication(LubricationModel::Spheres);
    let mut equal = facing(1.0, 2.0);
    equal.radii = [0.8; 2];
    let h: f64 = 0.05;
    let found = film.resistance(h, &equal);
    assert!((found.normal / (1.5 * PI * 0.3 * 0.64 / h) - 1.0).abs() < 1e-6);
    let shear = 0.5 * PI * 0.3 * (-1.6 + (1.6 + h) * ((1.6 + h) / h).ln());
    assert!((found.tangential / shear - 1.0).abs() < 1e-4);
    assert_eq!(film.resistance(1e-4, &equal), film.resistance(1e-3, &equal));
    assert_eq!(film.resistance(-0.1, &equal), film.resistance(1e-3, &equal));
    let near = Lubrication { range: 0.2, ..film };
    assert_eq!(near.resistance(0.2, &equal), Resistance::default());
    assert!(near.resistance(0.1999, &equal).normal < 2e-3 * near.resistance(0.02, &equal).normal);
}

#[test]
fn the_error_function() {
    for (x, y) in [
        (0.0, 0.0),
        (0.5, 0.520_499_877_813_046_5),
        (-2.0, -0.995_322_265_018_952_7),
        (4.0, 0.999_999_984_582_742_1),
    ] {
        assert!((erf(x) - y).abs() < 1e-14);
    }
}

#[test]
fn constants_are_checked() {
    let refused = |r, a, l| Far::new(r, a, l).expect_err("refused").to_string();
    let wrong = Repulsion {
        contact_gap: 1.0,
        ..repulsion()
    };
    assert!(refused(Some(wrong), None, None).contains("contact_gap is 1"));
    let wrong = VanDerWaals {
        closest: 0.0,
        ..adhesion()
    };
    assert!(refused(None, Some(wrong), None).contains("closest is 0"));
    let wrong = Lubrication {
        range: 1e-4,
        ..lubrication(LubricationModel::Cylinders)
    };
    assert!(refused(None, None, Some(wrong)).contains("above the inner cut-off"));
}
