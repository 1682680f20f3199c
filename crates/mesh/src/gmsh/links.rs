//! `$Periodic` of a Gmsh mesh, by indices of nodes.

use super::sections::PeriodicLink;
use super::tags::Tags;
use crate::periodic::{Link, TOLERANCE};

/// The links by index; those of surfaces with their translation.
pub(super) fn links(
    given: &[PeriodicLink],
    tags: &Tags,
    nodes: &[[f64; 3]],
) -> Result<Vec<Link>, String> {
    let by_index = |link: &PeriodicLink| {
        let pairs = link.pairs.iter();
        let pairs = pairs.map(|&[slave, master]| Ok([tags.index(slave)?, tags.index(master)?]));
        let pairs = pairs.collect::<Result<Vec<_>, String>>()?;
        let translation = match link.dimension {
            2 => Some(translation(link, &pairs, nodes)?),
            _ => None,
        };
        Ok(Link {
            names: [link.entity.to_string(), link.master.to_string()],
            translation,
            pairs,
        })
    };
    given.iter().map(by_index).collect()
}

/// The translation from master to slave.
fn translation(
    link: &PeriodicLink,
    pairs: &[[u32; 2]],
    nodes: &[[f64; 3]],
) -> Result<[f64; 3], String> {
    if let [a, b, c, x, d, e, f, y, g, h, i, z, ..] = link.affine[..] {
        let rotation = [a - 1.0, b, c, d, e - 1.0, f, g, h, i - 1.0];
        if rotation.iter().any(|r| r.abs() > TOLERANCE) {
            return Err(format!(
                "surface {} is a rotated copy of surface {}; only translations are supported as periods",
                link.entity, link.master
            ));
        }
        return Ok([x, y, z]);
    }
    let Some(&[slave, master]) = pairs.first() else {
        return Err(format!(
            "periodic surface {} lists neither an affine map nor nodes",
            link.entity
        ));
    };
    let (b, a) = (nodes[slave as usize], nodes[master as usize]);
    Ok(std::array::from_fn(|c| b[c] - a[c]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(affine: &[f64], pairs: &[[u64; 2]]) -> String {
        let nodes = [[0.0; 3], [2.0, 0.0, 0.0]];
        let link = PeriodicLink {
            dimension: 2,
            entity: 7,
            master: 3,
            affine: affine.to_vec(),
            pairs: pairs.to_vec(),
        };
        let tags = Tags::new(&[1, 2]).expect("tags");
        links(&[link], &tags, &nodes).expect_err("refused")
    }

    #[test]
    fn what_is_no_translation_is_refused() {
        let mut turned = [0.0; 16];
        (turned[1], turned[4], turned[10], turned[15]) = (-1.0, 1.0, 1.0, 1.0);
        assert!(refused(&turned, &[[2, 1]]).contains("rotated copy of surface 3"));
        assert!(refused(&[], &[[9, 1]]).contains("node 9"));
        assert!(refused(&[], &[]).contains("neither"));
    }
}
