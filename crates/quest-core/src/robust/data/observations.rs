//! The matches as the search reads them: permuted, in columns, in pixels.
//!
//! A match is `x2ᵀ F x1 = 0` with `x` in pixels: `x = (fx u, fy v, 1)` for points on the plane `z = 1`, whose noise is that
//! of a flat image, and `x = f a` for unit bearings, whose noise is that of a sphere. `F = D2 E D1` brings an essential
//! matrix there. The Sampson error, in pixels, is
//!
//! ```text
//! r = e / √(|∂e/∂x1|² + |∂e/∂x2|²),   e = x2ᵀ F x1
//! ```
//!
//! with the gradients in the plane of the image, or in the tangent plane of the sphere.

use nalgebra::{Matrix3, Vector3};

use crate::Correspondence;
use crate::degeneracy::{are_spread_along, nearly_on_a_line};
use crate::robust::data::columns::Columns;
use crate::robust::data::image::{FramedMatch, Image};
use crate::robust::data::point_transfer::Framed;

/// How a match as it was given lies on the plane `z = 1`: rounding.
const ON_PLANE: f64 = 1e-9;

/// The matches of one estimate, in random order.
#[derive(Debug)]
pub(crate) struct Observations<'a> {
    /// All matches of the caller.
    pub(crate) given: &'a [Correspondence],
    /// Where each of those that are observed stands among them.
    pub(crate) order: Vec<u32>,
    /// Those that are observed, in columns.
    pub(crate) columns: Columns,
}

impl<'a> Observations<'a> {
    /// Some of the matches in this order, with the focal lengths of both views and the inlier threshold in pixels.
    pub(crate) fn new(
        given: &'a [Correspondence],
        order: Vec<u32>,
        focal_lengths: [[f64; 2]; 2],
        threshold: f64,
    ) -> Self {
        let matches = || order.iter().map(|&i| &given[i as usize]);
        let is_plane = matches().all(|m| {
            let off = |z: f64, length: f64| (z * length - 1.0).abs() < ON_PLANE;
            off(m.bearing1().z, m.length1()) && off(m.bearing2().z, m.length2())
        });
        let images = focal_lengths
            .map(|f| if is_plane { Image::Plane(f) } else { Image::Sphere((f[0] * f[1]).sqrt()) });
        let points = matches().map(|m| [*m.bearing1(), *m.bearing2()]);
        let columns = Columns::of_points(images, threshold, points);
        Self { given, order, columns }
    }

    pub(crate) fn len(&self) -> usize {
        self.order.len()
    }

    /// The match at this place of the order.
    pub(crate) fn at(&self, place: u32) -> &'a Correspondence {
        &self.given[self.order[place as usize] as usize]
    }

    /// The matches at some places of the order.
    pub(crate) fn some(&self, places: &[u32]) -> Vec<Correspondence> {
        places.iter().map(|&place| *self.at(place)).collect()
    }

    /// The first so many matches of the order, or all.
    pub(crate) fn first(&self, count: usize) -> Vec<Correspondence> {
        self.order.iter().take(count).map(|&i| self.given[i as usize]).collect()
    }

    pub(crate) fn is_sphere(&self) -> bool {
        self.columns.is_sphere()
    }

    /// Whether nothing but noise, below a threshold in pixels, tells some matches from those of points on a line.
    pub(crate) fn is_line(&self, some: &[Correspondence]) -> bool {
        nearly_on_a_line(some, self.thresholds())
    }

    /// Whether the line of some matches is long, which a threshold as wide as the image does not make it.
    pub(crate) fn is_long(&self, line: &[Correspondence]) -> bool {
        are_spread_along(line, self.thresholds())
    }

    /// The threshold in both views, in radians.
    fn thresholds(&self) -> [f64; 2] {
        let threshold = self.columns.threshold();
        self.columns.images().map(|image| threshold / image.square_focal_length().sqrt())
    }

    /// The area of view 2, in square pixels, over which its points are spread: that of a rectangle, evenly filled, with
    /// their second moments.
    pub(crate) fn area_of_view2(&self) -> f64 {
        let point = |i| Vector3::from(std::array::from_fn(|k| self.columns.at(3 + k, i)));
        let points = || (0..self.len()).map(point);
        let count = self.len() as f64;
        let mean = points().sum::<Vector3<f64>>() / count;
        let moments = points().map(|x| (x - mean) * (x - mean).transpose()).sum::<Matrix3<f64>>() / count;
        // w² h² / 144, as the sum of the principal minors: on a sphere no axis is special.
        let square = 0.5 * (moments.trace().powi(2) - (moments * moments).trace());
        12.0 * square.max(0.0).sqrt()
    }

    /// Some of the matches with the frames of both views.
    pub(crate) fn framed(&self, indices: &[u32]) -> Framed {
        let [image1, image2] = self.columns.images();
        let framed = |&index: &u32| {
            let [x1, x2] = self.columns.vectors(index as usize);
            FramedMatch { x1, x2, frame1: image1.frame(&x1), frame2: image2.frame(&x2) }
        };
        Framed::new(&indices.iter().map(framed).collect::<Vec<_>>())
    }
}
