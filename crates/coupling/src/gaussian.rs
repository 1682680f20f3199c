//! The Gaussian kernel: nodes of any rank within a cut-off, corrected so that linear fields are exact.
//!
//! With r = (x_i − x)/σ, φ = (1, r) and g_i = V_i exp(−½r²)/(σ³ (2π)^(3/2)) the weights of velocity and gradient are
//!
//! ```text
//! w_i = g_i φ_iᵀ M⁻¹ e_0,   ∂_k w_i = g_i φ_iᵀ M⁻¹ e_k / σ,   M = Σ g_i φ_i φ_iᵀ
//! ```
//!
//! so Σ w_i = 1, Σ w_i (x_i − x) = 0, Σ ∂_k w_i = 0 and Σ ∂_k w_i (x_i − x)_l = δ_kl, at walls too. (∂_k w is the
//! derivative of the Gaussian itself, corrected as w is: the diffuse derivative of Nayroles, Touzot & Villon 1992.) A rank
//! needs its own nodes only: it adds up the moments Σ g φ φᵀ and Σ g φ uᵀ; the owner of the point sums those of all ranks
//! that the kernel reaches, and solves. Force and torque go back as the 4×3 coefficients C = M⁻¹ [F; ½ T × e_k/σ] of
//! f_i = g_i Cᵀφ_i. So a sample is one question and one answer to the ranks in reach, a spread one message.

use crate::boxes::{Bins, Bounds};
use crate::coupling::Fields;
use crate::lattice::Lattice;
use crate::locate::Near;
use crate::pairs::Places;
use crate::rendezvous::{Flow, Host, Kept, Source};
use crate::spread::Sums;
use crate::{Coupling, CouplingError, Kernel};
use bytemuck::{Pod, Zeroable};
use fibreflow_fibre::{Ambient, Reaction};
use fibreflow_mesh::{DualGeometry, LocalMesh};
use nalgebra::{Matrix4, Matrix4x3, Vector3};
use rayon::prelude::*;
use std::sync::Arc;

/// Pivots of M below this say that the nodes in reach lie on a plane, or that there are none.
const SMALLEST_PIVOT: f64 = 1e-3;

/// The kernel on this rank, and where the points of this rank were last.
pub(crate) struct Gaussian {
    width: f64,
    lattice: Lattice,
    /// Bounds of the nodes that each rank owns.
    bounds: Vec<Bounds>,
    /// Owned nodes.
    bins: Bins,
    mesh: Arc<LocalMesh>,
    geometry: Arc<DualGeometry>,
    sites: Vec<Site>,
}

/// A point of this rank.
struct Site {
    /// In the cell of the mesh \[m\].
    wrapped: Vector3<f64>,
    /// From there to the point's own image \[m\].
    beyond: Vector3<f64>,
    /// M⁻¹
    inverse: Matrix4<f64>,
}

/// Sums over the nodes of a rank.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Moments {
    /// Σ g φ φᵀ, lower triangle by columns.
    gram: [f64; 10],
    /// Σ g φ uᵀ
    flow: [[f64; 3]; 4],
    change: [[f64; 3]; 4],
}

/// A load on its way to the nodes of a rank.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Load {
    position: [f64; 3],
    coefficients: [[f64; 3]; 4],
}

/// An image of a load that reaches nodes of this rank.
struct Item {
    centre: Vector3<f64>,
    wrapped: Vector3<f64>,
    coefficients: [[f64; 3]; 4],
}

impl Gaussian {
    /// Collective: gathers the bounds of all ranks once.
    pub fn new(
        mesh: &Arc<LocalMesh>,
        geometry: &Arc<DualGeometry>,
        lattice: Lattice,
        width: f64,
    ) -> Self {
        let owned = &mesh.nodes[..mesh.owned()];
        let around = Bounds::around(owned);
        let mine = [around.low, around.high].map(<[f64; 3]>::from);
        let bounds = mesh.halo.communicator().all_gather(&mine).into_iter();
        let boxes: Vec<Bounds> = owned.iter().map(|x| Bounds::around([x])).collect();
        Self {
            width,
            lattice,
            bounds: bounds
                .map(|corners| Bounds {
                    low: corners[0].into(),
                    high: corners[1].into(),
                })
                .collect(),
            bins: Bins::new(&boxes),
            mesh: mesh.clone(),
            geometry: geometry.clone(),
            sites: Vec::new(),
        }
    }

    fn reach(&self) -> f64 {
        Kernel::REACH * self.width
    }

    /// Images of a wrapped point whose kernel may reach nodes of a rank.
    fn images(&self, wrapped: Vector3<f64>, rank: usize) -> impl Iterator<Item = Vector3<f64>> {
        let shifts = self.lattice.images(&wrapped);
        let images = shifts.map(move |shift| self.lattice.image(&wrapped, shift));
        images.filter(move |x| self.bounds[rank].distance(x) <= self.reach())
    }

    fn ranks(&self, wrapped: &Vector3<f64>) -> impl Iterator<Item = usize> {
        let wrapped = *wrapped;
        (0..self.bounds.len()).filter(move |&rank| self.images(wrapped, rank).next().is_some())
    }

    /// V g and r of a node, if it is in reach of a point.
    #[inline(always)]
    fn weight(&self, node: usize, centre: &Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
        let r = (Vector3::from(self.mesh.nodes[node]) - centre) / self.width;
        let square = r.norm_squared();
        (square <= Kernel::REACH * Kernel::REACH).then(|| {
            let norm = (2.0 * std::f64::consts::PI).sqrt() * self.width;
            let volume = self.geometry.volumes[node] / (norm * norm * norm);
            (volume * (-0.5 * square).exp(), r)
        })
    }

    fn moments(&self, wrapped: &[f64; 3], fields: &Fields<'_>, rank: usize) -> Moments {
        let mut moments = Moments::zeroed();
        for centre in self.images((*wrapped).into(), rank) {
            let ball = Bounds::around([&centre.into()]).inflated(self.reach());
            self.bins.within(&ball, |node| {
                let node = node as usize;
                if let Some((g, r)) = self.weight(node, &centre) {
                    moments.add(
                        g,
                        &r,
                        &fields.velocity[node],
                        fields.change.map(|c| &c[node]),
                    );
                }
            });
        }
        moments
    }

    /// Force on a node by all loads, and the sums of arm × force and of (point in the cell) × force.
    fn gather(&self, node: usize, items: &[Item], bins: &Bins) -> [Vector3<f64>; 3] {
        let mut sums = [Vector3::zeros(); 3];
        let ball = Bounds::around([&self.mesh.nodes[node]]).inflated(self.reach());
        bins.within(&ball, |k| {
            let item = &items[k as usize];
            let Some((g, r)) = self.weight(node, &item.centre) else {
                return;
            };
            let c = &item.coefficients;
            let force = Vector3::from_fn(|a, _| {
                g * (c[0][a] + r.x * c[1][a] + r.y * c[2][a] + r.z * c[3][a])
            });
            sums[0] += force;
            sums[1] += self.width * r.cross(&force);
            sums[2] += item.wrapped.cross(&force);
        });
        sums
    }
}

impl Moments {
    #[inline(always)]
    fn add(&mut self, g: f64, r: &Vector3<f64>, u: &[f64; 4], change: Option<&[f64; 4]>) {
        let phi = [g, g * r.x, g * r.y, g * r.z];
        let basis = [1.0, r.x, r.y, r.z];
        let mut entry = 0;
        for j in 0..4 {
            for i in j..4 {
                self.gram[entry] += phi[i] * basis[j];
                entry += 1;
            }
            (0..3).for_each(|c| self.flow[j][c] += phi[j] * u[c]);
        }
        if let Some(change) = change {
            for j in 0..4 {
                (0..3).for_each(|c| self.change[j][c] += phi[j] * change[c]);
            }
        }
    }

    fn merge(&mut self, other: &Self) {
        let mine: &mut [f64] = bytemuck::cast_slice_mut(std::slice::from_mut(self));
        let theirs: &[f64] = bytemuck::cast_slice(std::slice::from_ref(other));
        mine.iter_mut().zip(theirs).for_each(|(a, b)| *a += b);
    }

    fn inverse(&self) -> Option<Matrix4<f64>> {
        let mut gram = Matrix4::zeros();
        let mut entry = 0;
        for j in 0..4 {
            for i in j..4 {
                gram[(i, j)] = self.gram[entry];
                gram[(j, i)] = self.gram[entry];
                entry += 1;
            }
        }
        let factor = gram.cholesky()?;
        let least = factor.l_dirty().diagonal().min();
        (least * least > SMALLEST_PIVOT).then(|| factor.inverse())
    }
}

fn matrix(rows: &[[f64; 3]; 4]) -> Matrix4x3<f64> {
    Matrix4x3::from_fn(|i, j| rows[i][j])
}

/// No flow: it is asked for places alone.
struct Nowhere;

impl Source for Nowhere {
    fn flow(&self, _: &Near<'_>, _: [f64; 3], _: &mut Kept) -> Flow {
        Flow::default()
    }

    fn fetch(&self, _: u32) {}
}

impl Coupling {
    /// u and ∇u from the moments of all ranks in reach; points beyond a wall are held at its nearest place.
    pub(crate) fn sample_gaussian(
        &mut self,
        gaussian: &mut Gaussian,
        fields: &Fields<'_>,
        points: &[Vector3<f64>],
        ambient: &mut Ambient,
    ) -> Result<(), CouplingError> {
        self.place_sites(gaussian, points, ambient)?;
        let communicator = self.communicator().clone();
        let mut asked: Vec<Vec<[f64; 3]>> = vec![Vec::new(); communicator.size()];
        let mut owners = vec![Vec::new(); communicator.size()];
        for (k, site) in gaussian.sites.iter().enumerate() {
            for rank in gaussian.ranks(&site.wrapped) {
                asked[rank].push(site.wrapped.into());
                owners[rank].push(k);
            }
        }
        let rank = communicator.rank();
        let answers = communicator.exchange(asked).into_iter().map(|points| {
            let one = |x: &[f64; 3]| gaussian.moments(x, fields, rank);
            points.par_iter().with_min_len(4).map(one).collect()
        });
        let answered: Vec<Vec<Moments>> = communicator.exchange(answers.collect());
        let mut moments = vec![Moments::zeroed(); points.len()];
        for (owners, answers) in owners.iter().zip(&answered) {
            for (&k, answer) in owners.iter().zip(answers) {
                moments[k].merge(answer);
            }
        }
        let mut unresolved = None;
        ambient.velocity.clear();
        ambient.gradient.clear();
        ambient.change.clear();
        for (site, moments) in gaussian.sites.iter_mut().zip(&moments) {
            match moments.inverse() {
                Some(inverse) => site.inverse = inverse,
                None => unresolved = Some(site.wrapped + site.beyond),
            }
            let flow = site.inverse * matrix(&moments.flow);
            ambient.velocity.push(flow.row(0).transpose());
            let gradient = flow.fixed_rows::<3>(1).transpose() / gaussian.width;
            ambient.gradient.push(gradient);
            if fields.change.is_some() {
                let change = site.inverse * matrix(&moments.change);
                ambient.change.push(change.row(0).transpose());
            }
        }
        let failed = communicator.any(unresolved.is_some());
        match unresolved {
            Some(position) => Err(CouplingError::Unresolved {
                width: gaussian.width,
                position: position.into(),
            }),
            None if failed => Err(CouplingError::OtherRank),
            None => Ok(()),
        }
    }

    /// Finds the element of every point, which says who is near and where those beyond walls are held.
    fn place_sites(
        &mut self,
        gaussian: &mut Gaussian,
        points: &[Vector3<f64>],
        ambient: &mut Ambient,
    ) -> Result<(), CouplingError> {
        let host = Host {
            mesh: &self.mesh,
            locator: &self.locator,
            source: Nowhere,
        };
        let places = Places::new(points, false)?;
        self.rendezvous.place(&places, None, &host, ambient)?;
        gaussian.sites.clear();
        let lattice = &gaussian.lattice;
        gaussian
            .sites
            .extend(self.rendezvous.held.iter().map(|&held| {
                let wrapped = lattice.image(&held, lattice.wrap(&held));
                Site {
                    wrapped,
                    beyond: held - wrapped,
                    inverse: Matrix4::identity(),
                }
            }));
        Ok(())
    }

    /// f_i = g_i Cᵀφ_i on the owned nodes of all ranks, into `nodal`.
    pub(crate) fn spread_gaussian(
        &mut self,
        gaussian: &Gaussian,
        reaction: &Reaction,
        sums: &mut Sums,
    ) {
        let communicator = self.communicator().clone();
        let mut outgoing = vec![Vec::new(); communicator.size()];
        for (k, site) in gaussian.sites.iter().enumerate() {
            let (force, torque) = (&reaction.force[k], &reaction.torque[k]);
            let mut given = Matrix4x3::zeros();
            given.set_row(0, &force.transpose());
            for axis in 0..3 {
                let mut unit = Vector3::zeros();
                unit[axis] = 0.5 / gaussian.width;
                given.set_row(axis + 1, &torque.cross(&unit).transpose());
            }
            let coefficients = site.inverse * given;
            let load = Load {
                position: site.wrapped.into(),
                coefficients: std::array::from_fn(|i| {
                    std::array::from_fn(|j| coefficients[(i, j)])
                }),
            };
            gaussian
                .ranks(&site.wrapped)
                .for_each(|rank| outgoing[rank].push(load));
            // The frame of the sums below is that of the cell.
            sums.torque += site.beyond.cross(force);
            sums.torque_defect -= site.wrapped.cross(force) + torque;
        }
        let mut items = Vec::new();
        for load in communicator.exchange(outgoing).iter().flatten() {
            let wrapped = Vector3::from(load.position);
            let images = gaussian.images(wrapped, communicator.rank());
            items.extend(images.map(|centre| Item {
                centre,
                wrapped,
                coefficients: load.coefficients,
            }));
        }
        let centres = items
            .iter()
            .map(|item| Bounds::around([&item.centre.into()]));
        let bins = Bins::at_least(&centres.collect::<Vec<_>>(), gaussian.width);
        let owned = self.mesh.owned();
        let gathered: Vec<[Vector3<f64>; 3]> = (0..owned)
            .into_par_iter()
            .with_min_len(256)
            .map(|node| gaussian.gather(node, &items, &bins))
            .collect();
        for (nodal, [force, moment, arm]) in self.nodal.iter_mut().zip(&gathered) {
            (0..3).for_each(|c| nodal[c] = force[c]);
            sums.torque += arm + moment;
            sums.torque_defect += arm + moment;
        }
    }
}
