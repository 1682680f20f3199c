//! Forces of the case on the fluid.

use super::mesh::SceneMesh;
use crate::case::{CaseError, Document, PointForce};
use fibreflow_mesh::Image;

/// Body force \[N/m³\] by owned node: every force F as F g/Σ V g, with g a Gaussian and all its periodic images. Empty
/// without forces. Collective.
///
/// # Errors
/// A force that no node feels.
pub fn body_force(
    forces: &[PointForce],
    document: &Document,
    mesh: &SceneMesh,
) -> Result<Vec<[f64; 4]>, Box<CaseError>> {
    if forces.is_empty() {
        return Ok(Vec::new());
    }
    let (local, volumes) = (&mesh.local, &mesh.geometry.volumes);
    let images = images(mesh);
    let mut field = vec![[0.0; 4]; local.owned()];
    for (k, point) in forces.iter().enumerate() {
        let scale = -0.5 / (point.width * point.width);
        let at = |x: &[f64; 3]| -> f64 {
            let one = |shift: &[f64; 3]| {
                let apart = |c: usize| x[c] - point.position[c] - shift[c];
                (scale * (0..3).map(|c| apart(c).powi(2)).sum::<f64>()).exp()
            };
            images.iter().map(one).sum()
        };
        let kernel: Vec<f64> = local.nodes[..local.owned()].iter().map(at).collect();
        let sum = kernel.iter().zip(volumes).map(|(g, v)| g * v).sum();
        let sum = local.halo.communicator().sum(sum);
        if sum <= 1e-6 * point.width.powi(3) {
            let path = format!("fluid.forces[{k}].position");
            let message = format!("`{path} = {:?}` is where no node feels it", point.position);
            let error = document.value_error(&path, message);
            return Err(
                error.with_help("a point of the domain, and a `width` of some node spacings")
            );
        }
        for (f, g) in field.iter_mut().zip(&kernel) {
            (0..3).for_each(|c| f[c] += g / sum * point.force[c]);
        }
    }
    Ok(field)
}

/// Shifts of the nearest periodic images \[m\], that of none among them.
fn images(mesh: &SceneMesh) -> Vec<[f64; 3]> {
    let periods = &mesh.local.periods;
    let all = (0..27).filter_map(Image::from_code);
    let real = |image: &Image| {
        let shifts = image.shifts().into_iter().enumerate();
        let mut used = shifts.filter(|(_, n)| *n != 0).map(|(k, _)| k);
        used.all(|direction| periods.is_periodic(direction))
    };
    all.filter(real).map(|image| periods.shift(image)).collect()
}
