//! Periodic surfaces of a Gmsh mesh: lattice vectors, and which nodes are copies of which.

use super::sections::PeriodicLink;
use super::tags::Tags;
use crate::{Image, Periods};

/// Parts of a period by which copies may be off their place.
const TOLERANCE: f64 = 1e-5;

/// What a node of the file is: image `image` of node `master` (itself with [`Image::ZERO`] when it has no master).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Copy {
    pub master: u32,
    pub image: Image,
}

/// Lattice vectors, and the master and image of every node.
///
/// A copy of a copy (nodes on edges and corners of a box that is periodic in several directions) goes back to one
/// master, the one with the lowest images.
pub(super) fn identify(
    links: &[PeriodicLink],
    tags: &Tags,
    nodes: &[[f64; 3]],
) -> Result<(Periods, Vec<Copy>), String> {
    let mut periods = Periods::default();
    for link in links.iter().filter(|l| l.dimension == 2) {
        let translation = translation(link, tags, nodes)?;
        add_vector(&mut periods, translation, link)?;
    }
    let mut classes = Classes::new(nodes.len());
    for link in links {
        for &[slave, master] in &link.pairs {
            let (slave, master) = (tags.index(slave)?, tags.index(master)?);
            let (a, b) = (nodes[master as usize], nodes[slave as usize]);
            let difference = std::array::from_fn(|c| b[c] - a[c]);
            let shift = shift_of(&periods, difference).ok_or_else(|| {
                format!(
                    "the node at {b:?} is called a periodic copy of the one at {a:?}, but no combination of the periods {:?} lies between them",
                    in_use(&periods)
                )
            })?;
            classes.join(master, slave, shift).map_err(|shift| {
                format!("the node at {b:?} is a periodic copy of itself, {shift:?} periods apart")
            })?;
        }
    }
    Ok((periods, classes.copies(nodes)?))
}

fn in_use(periods: &Periods) -> Vec<[f64; 3]> {
    let used = (0..3).filter(|&k| periods.is_periodic(k));
    used.map(|k| periods.vectors[k]).collect()
}

fn length(v: [f64; 3]) -> f64 {
    v.iter().map(|c| c * c).sum::<f64>().sqrt()
}

/// The translation from master to slave.
fn translation(link: &PeriodicLink, tags: &Tags, nodes: &[[f64; 3]]) -> Result<[f64; 3], String> {
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
    let Some(&[slave, master]) = link.pairs.first() else {
        return Err(format!(
            "periodic surface {} lists neither an affine map nor nodes",
            link.entity
        ));
    };
    let (b, a) = (
        nodes[tags.index(slave)? as usize],
        nodes[tags.index(master)? as usize],
    );
    Ok(std::array::from_fn(|c| b[c] - a[c]))
}

/// Adds a lattice vector, in the slot of its largest component where that is free, unless it is there already.
fn add_vector(periods: &mut Periods, vector: [f64; 3], link: &PeriodicLink) -> Result<(), String> {
    let largest = (0..3).max_by(|&a, &b| vector[a].abs().total_cmp(&vector[b].abs()));
    let axis = largest.unwrap_or(0);
    if vector[axis] == 0.0 || !vector[axis].is_finite() {
        return Err(format!(
            "periodic surfaces {} and {} lie in the same place",
            link.entity, link.master
        ));
    }
    let vector = vector.map(|c| c * vector[axis].signum());
    let same = |k: usize| {
        let known = periods.vectors[k];
        length(std::array::from_fn(|c| known[c] - vector[c])) <= TOLERANCE * length(vector)
    };
    if (0..3).any(same) {
        return Ok(());
    }
    let mut slots = [axis, 0, 1, 2].into_iter();
    let free = slots.find(|&k| !periods.is_periodic(k));
    let slot = free.ok_or_else(|| {
        format!(
            "a fourth period {vector:?} is not supported: there are {:?}",
            in_use(periods)
        )
    })?;
    periods.vectors[slot] = vector;
    Ok(())
}

/// Multiples −1…1 of the lattice vectors that make up a difference.
fn shift_of(periods: &Periods, difference: [f64; 3]) -> Option<[i32; 3]> {
    let smallest = in_use(periods).into_iter().map(length);
    let allowed = TOLERANCE * smallest.fold(f64::INFINITY, f64::min);
    (0..27).filter_map(Image::from_code).find_map(|image| {
        let unused = |k: usize| image.shifts()[k] != 0 && !periods.is_periodic(k);
        let shift = periods.shift(image);
        let off = length(std::array::from_fn(|c| shift[c] - difference[c]));
        (!(0..3).any(unused) && off <= allowed).then(|| image.shifts().map(i32::from))
    })
}

/// Union–find whose links carry the shift from the parent.
struct Classes {
    parent: Vec<u32>,
    shift: Vec<[i32; 3]>,
}

fn add(a: [i32; 3], b: [i32; 3]) -> [i32; 3] {
    std::array::from_fn(|k| a[k] + b[k])
}

fn subtract(a: [i32; 3], b: [i32; 3]) -> [i32; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}

impl Classes {
    fn new(nodes: usize) -> Self {
        Self {
            parent: (0..nodes as u32).collect(),
            shift: vec![[0; 3]; nodes],
        }
    }

    /// Root of a node and the shift from the root to the node.
    fn root(&mut self, node: u32) -> (u32, [i32; 3]) {
        let (mut root, mut shift) = (node, [0; 3]);
        while self.parent[root as usize] != root {
            shift = add(shift, self.shift[root as usize]);
            root = self.parent[root as usize];
        }
        self.parent[node as usize] = root;
        self.shift[node as usize] = shift;
        (root, shift)
    }

    /// Notes that `slave` lies `shift` from `master`; the contradiction as error.
    fn join(&mut self, master: u32, slave: u32, shift: [i32; 3]) -> Result<(), [i32; 3]> {
        let (of_master, a) = self.root(master);
        let (of_slave, b) = self.root(slave);
        let between = subtract(add(a, shift), b);
        if of_master == of_slave {
            return if between == [0; 3] {
                Ok(())
            } else {
                Err(between)
            };
        }
        self.parent[of_slave as usize] = of_master;
        self.shift[of_slave as usize] = between;
        Ok(())
    }

    fn copies(mut self, nodes: &[[f64; 3]]) -> Result<Vec<Copy>, String> {
        let count = nodes.len() as u32;
        let found: Vec<(u32, [i32; 3])> = (0..count).map(|n| self.root(n)).collect();
        // Of every class, by its root: the member with the lowest shifts.
        let mut lowest: Vec<u32> = (0..count).collect();
        for node in 0..count {
            let (root, shift) = found[node as usize];
            let best = &mut lowest[root as usize];
            let rank = |shift: [i32; 3]| (shift.iter().sum::<i32>(), shift);
            if rank(shift) < rank(found[*best as usize].1) {
                *best = node;
            }
        }
        let copy = |(node, &(root, shift)): (usize, &(u32, [i32; 3]))| {
            let master = lowest[root as usize];
            let shift = subtract(shift, found[master as usize].1);
            if shift.iter().any(|s| s.abs() > 1) {
                return Err(format!(
                    "the node at {:?} is a copy of one {shift:?} periods away; a period must reach from one side of the domain to the other",
                    nodes[node]
                ));
            }
            Ok(Copy {
                master,
                image: Image::new(shift.map(|s| s as i8)),
            })
        };
        found.iter().enumerate().map(copy).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn link(affine: &[f64], pairs: &[[u64; 2]]) -> PeriodicLink {
        PeriodicLink {
            dimension: 2,
            entity: 7,
            master: 3,
            affine: affine.to_vec(),
            pairs: pairs.to_vec(),
        }
    }

    fn moved(x: f64, y: f64) -> [f64; 16] {
        let mut affine = [0.0; 16];
        (0..4).for_each(|k| affine[5 * k] = 1.0);
        (affine[3], affine[7]) = (x, y);
        affine
    }

    /// Corners of a 2 × 1 rectangle, tags 1 to 4, counter-clockwise.
    fn corners() -> (Tags, Vec<[f64; 3]>) {
        let nodes = vec![[0.0; 3], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        (Tags::new(&[1, 2, 3, 4]).expect("tags"), nodes)
    }

    #[test]
    fn chains_at_a_corner_end_at_one_master() {
        let (tags, nodes) = corners();
        // 3 is a copy of 2 (in y) and 2 of 1 (in x); the link for x runs against it, from right to left.
        let links = [
            link(&moved(0.0, 1.0), &[[3, 2], [4, 1]]),
            link(&moved(-2.0, 0.0), &[[1, 2], [4, 3]]),
        ];
        let (periods, copies) = identify(&links, &tags, &nodes).expect("periodic");
        assert_eq!(
            periods.vectors,
            [[2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0; 3]]
        );
        let images = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]];
        for (copy, image) in copies.iter().zip(images) {
            assert_eq!(
                *copy,
                Copy {
                    master: 0,
                    image: Image::new(image)
                }
            );
        }
    }

    #[test]
    fn what_cannot_be_a_lattice_is_refused() {
        let (tags, nodes) = corners();
        let refused = |link: PeriodicLink| identify(&[link], &tags, &nodes).expect_err("refused");
        let mut turned = moved(2.0, 0.0);
        (turned[0], turned[1], turned[4], turned[5]) = (0.0, -1.0, 1.0, 0.0);
        assert!(refused(link(&turned, &[[2, 1]])).contains("rotated copy of surface 3"));
        assert!(refused(link(&moved(2.0, 0.0), &[[3, 1]])).contains("no combination"));
        assert!(refused(link(&moved(2.0, 0.0), &[[9, 1]])).contains("node 9"));
        assert!(refused(link(&moved(0.0, 0.0), &[])).contains("same place"));
        assert!(refused(link(&[], &[])).contains("neither"));
    }
}
