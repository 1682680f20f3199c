//! Laws against hand-made limits and finite differences.

use super::*;

const WATER: FluidProperties = FluidProperties {
    density: 1000.0,
    viscosity: 1e-3,
};
const SECTION: Section = Section {
    diameter: 2e-5,
    fibre_length: 1e-3,
    segment_length: 1e-4,
    place: -0.9,
};
const AUTO: DragModel = DragModel::Auto(SlenderConstants::Batchelor);

const ALL: [DragModel; 8] = [
    DragModel::SlenderBody(SlenderConstants::Batchelor),
    DragModel::SlenderBody(SlenderConstants::Kunhappan),
    DragModel::InfiniteCylinder,
    AUTO,
    DragModel::SlenderBody(SlenderConstants::Ends),
    DragModel::Auto(SlenderConstants::Ends),
    DragModel::ProlateSpheroid(SpheroidRatio::Cox),
    DragModel::ProlateSpheroid(SpheroidRatio::Bretherton),
];

fn force(model: DragModel, slip: Vector3<f64>) -> Vector3<f64> {
    let t = Vector3::new(0.6, 0.0, 0.8);
    model
        .resistance(&t, &slip, &SECTION, &WATER)
        .force(&t, &slip)
}

/// Normal slip that gives this Reynolds number.
fn normal_slip(re: f64) -> Vector3<f64> {
    Vector3::new(
        0.0,
        re * WATER.viscosity / (WATER.density * SECTION.diameter),
        0.0,
    )
}

#[test]
fn the_cylinder_law_gives_its_drag_coefficient() {
    for (re, c_n) in [(0.1, 58.31), (100.0, 1.4001)] {
        let slip = normal_slip(re);
        let f = force(DragModel::InfiniteCylinder, slip).norm();
        let c = f / (0.5 * WATER.density * SECTION.diameter * slip.norm_squared());
        assert!((c / c_n - 1.0).abs() < 1e-4, "Re {re}: {c}");
    }
}

#[test]
fn drag_opposes_slip_and_is_larger_across() {
    for model in ALL {
        for re in [1e-8, 1e-4, 1e-2, 1.0, 50.0, 500.0] {
            let slip = normal_slip(re) + Vector3::new(0.003, 0.0, 0.001);
            assert!(force(model, slip).dot(&slip) > 0.0);
            let t = Vector3::z();
            let r = model.resistance(&t, &slip, &SECTION, &WATER);
            assert!(r.normal > r.axial && r.axial > 0.0, "{model:?} {re} {r:?}");
        }
    }
}

/// Pure axial slip has Re = 0: the force must neither vanish for `auto` nor jump when a normal slip appears.
#[test]
fn force_is_finite_and_smooth_where_the_normal_slip_vanishes() {
    let axial = 0.05 * Vector3::new(0.6, 0.0, 0.8);
    let slender = SlenderConstants::Batchelor.resistance(50.0, WATER.viscosity);
    let at_zero = force(AUTO, axial);
    assert!((at_zero.norm() - 0.05 * slender.axial).abs() < 1e-15);
    for model in ALL {
        assert!(force(model, Vector3::zeros()).norm() == 0.0);
        let centre = force(model, axial);
        let e = normal_slip(1e-9);
        let (up, down) = (force(model, axial + e), force(model, axial - e));
        assert!(
            ((up + down) * 0.5 - centre).norm() < 1e-6 * centre.norm(),
            "{model:?}"
        );
    }
}

/// Central differences of the force along the slip do not jump anywhere.
#[test]
fn auto_is_continuously_differentiable() {
    let ratio = 1.002_f64;
    let value = |re: f64| force(AUTO, normal_slip(re)).norm();
    let (mut re, mut last) = (1e-4, 1.0);
    while re < 1e3 {
        let slope = (value(re * ratio) / value(re)).ln() / ratio.ln();
        assert!(
            (slope - last).abs() < 1e-2,
            "kink at Re {re}: {last} {slope}"
        );
        last = slope;
        re *= ratio;
    }
}

#[test]
fn auto_takes_the_larger_law() {
    for re in [1e-4, 1e-3, 0.1, 10.0, 300.0] {
        let slip = normal_slip(re);
        let laws = [ALL[0], ALL[2]].map(|m| force(m, slip).norm());
        let auto = force(AUTO, slip).norm();
        let largest = laws[0].max(laws[1]);
        assert!(
            auto >= largest && auto < 1.026 * largest,
            "{re}: {auto} {laws:?}"
        );
    }
}

/// Every law's analytic derivatives by slip and by tangent against central differences, in all ranges of the Reynolds
/// number and in both joins, with the normal slip far below and far above the axial one.
#[test]
fn derivatives_are_those_of_the_force() {
    let t = Vector3::new(0.48, -0.6, 0.64);
    let across = t.cross(&Vector3::new(0.2, 0.9, 0.3)).normalize();
    let of = |model: DragModel, t: &Vector3<f64>, slip: &Vector3<f64>| {
        let r = model.resistance(t, slip, &SECTION, &WATER);
        r.force(t, slip)
    };
    for model in ALL {
        for re in [
            0.0, 1e-7, 1e-5, 3e-3, 2e-2, 0.095, 0.11, 5.0, 97.0, 104.0, 800.0,
        ] {
            for share in [0.0, 0.3, 20.0] {
                let speed = re * WATER.viscosity / (WATER.density * SECTION.diameter);
                let slip = across * speed + t * (share * speed + 1e-6);
                let response = model.response(&t, &slip, &SECTION, &WATER);
                let size = slip.norm();
                // Below Re 1e-6 the resistance itself changes over smaller slips.
                let h = if re < 1e-3 {
                    1e-3 * speed.max(4e-11)
                } else {
                    1e-5 * size
                };
                for j in 0..3 {
                    let e = Vector3::ith(j, 1.0);
                    let up = of(model, &t, &(slip + e * h));
                    let down = of(model, &t, &(slip - e * h));
                    let error = ((up - down) / (2.0 * h) - response.by_slip.column(j)).norm();
                    assert!(
                        error < 2e-5 * response.resistance.normal,
                        "{model:?}, Re {re}, axial {share}: by slip {error:e}"
                    );
                }
                let by_turn = [across, t.cross(&across)];
                for side in by_turn {
                    let a = if re < 1e-3 {
                        1e-3 * (speed / size).max(4e-5)
                    } else {
                        1e-5
                    };
                    let turned = |a: f64| t * a.cos() + side * a.sin();
                    let change = of(model, &turned(a), &slip) - of(model, &turned(-a), &slip);
                    let error = (change / (2.0 * a) - response.by_tangent * side).norm();
                    assert!(
                        error < 2e-5 * response.resistance.normal * size,
                        "{model:?}, Re {re}, axial {share}: by tangent {error:e}"
                    );
                }
            }
        }
    }
}
