//! One pair: its matches, its estimate, its row.

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::Vector2;
use quest_core::robust::{self, Estimate, EstimateError, Model, Options, Priors};
use quest_core::{Camera, Correspondence};

use super::{Found, Uncalibrated, VerifyOptions};
use crate::geometry::{calibrations, homography};
use crate::image::Rays;
use crate::pixel_fit::{self, Kind, PixelMatch};
use crate::report::PairReport;
use crate::watermark::is_watermark;
use crate::{ColmapError, Config, Database, Matches, PairId, TwoViewGeometry};

/// A pair with all that its estimate needs.
pub(crate) struct Work {
    pub(crate) key: PairId,
    names: [String; 2],
    /// What is needed, or why it cannot be had.
    input: Result<Input, String>,
}

struct Input {
    matches: Matches,
    images: [Arc<Result<Rays, String>>; 2],
    cameras: [Camera; 2],
    is_calibrated: bool,
}

impl Work {
    pub(crate) fn new(
        database: &Database,
        key: PairId,
        matches: Found,
        images: &HashMap<i64, Arc<Result<Rays, String>>>,
    ) -> Self {
        let (a, b) = key.images();
        let input = matches.and_then(|matches| {
            let (first, second) = (database.camera_of(a)?, database.camera_of(b)?);
            let rays = |image| images.get(&image).cloned().ok_or_else(|| format!("image {image}: not read"));
            let images = [rays(a)?, rays(b)?];
            for image in &images {
                image.as_ref().as_ref().map_err(Clone::clone)?;
            }
            Ok(Input {
                matches,
                images,
                cameras: [first.camera.clone()?, second.camera.clone()?],
                is_calibrated: first.has_prior_focal_length && second.has_prior_focal_length,
            })
        });
        Self { key, names: [database.name(a), database.name(b)], input }
    }

    /// The row of the pair, `None` where it cannot be read, and what is told of it.
    pub(crate) fn verify(
        &self,
        options: &VerifyOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<(Option<TwoViewGeometry>, PairReport), ColmapError> {
        let [image1, image2] = self.names.clone();
        let mut report = PairReport {
            pair_id: self.key.0,
            image1,
            image2,
            matches: 0,
            invalid: 0,
            inliers: 0,
            config: None,
            reason: None,
            model: None,
            q_21: None,
            t_21: None,
            noise_px: None,
            iterations: None,
        };
        let read = self.input.as_ref().map_err(Clone::clone);
        let read = read.and_then(|input| Ok((input, input.usable()?)));
        let (input, usable) = match read {
            Ok(read) => read,
            Err(reason) => {
                report.reason = Some(reason);
                return Ok((None, report));
            }
        };
        report.matches = input.matches.0.len();
        report.invalid = report.matches - usable.places.len();
        let found = usable.estimate(input, self.key, options, is_cancelled)?;
        let geometry = found.and_then(|estimate| {
            report.tell(&estimate);
            input.row(&usable, &estimate, options)
        });
        let geometry = geometry.unwrap_or_else(|reason| {
            report.reason = Some(reason);
            TwoViewGeometry::undefined()
        });
        report.config = Some(geometry.config);
        report.inliers = geometry.inliers.0.len();
        Ok((Some(geometry), report))
    }

    /// The estimate of the pair and the names of its images, or why there is none.
    pub(crate) fn estimate(
        &self,
        options: &VerifyOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Result<Estimate, String>, ColmapError> {
        let read = self.input.as_ref().map_err(Clone::clone);
        match read.and_then(|input| Ok((input, input.usable()?))) {
            Ok((input, usable)) => usable.estimate(input, self.key, options, is_cancelled),
            Err(reason) => Ok(Err(reason)),
        }
    }
}

/// The matches that have rays, and their places among all.
struct Usable {
    matches: Vec<Correspondence>,
    places: Vec<usize>,
}

impl Usable {
    fn estimate(
        &self,
        input: &Input,
        key: PairId,
        options: &VerifyOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Result<Estimate, String>, ColmapError> {
        if self.matches.len() < options.min_inliers {
            let (found, needed) = (self.matches.len(), options.min_inliers);
            return Ok(Err(format!("found {found} matches, expected at least {needed}")));
        }
        let [camera1, camera2] = &input.cameras;
        let index = key.0.cast_unsigned();
        let search = Options { index, ..options.search.clone() }.with_cameras(camera1, camera2);
        match robust::estimate_until(&self.matches, &search, &Priors::default(), is_cancelled) {
            Err(EstimateError::Cancelled) => Err(ColmapError::Cancelled),
            other => Ok(other.map_err(|error| error.to_string())),
        }
    }

    /// The places of the inliers among all matches.
    fn chosen(&self, inliers: &[bool]) -> Vec<usize> {
        self.places
            .iter()
            .zip(inliers)
            .filter(|(_, is_inlier)| **is_inlier)
            .map(|(place, _)| *place)
            .collect()
    }
}

/// The matches that are inliers.
fn chosen<'a>(
    matches: &'a [Correspondence],
    inliers: &'a [bool],
) -> impl Iterator<Item = Correspondence> + 'a {
    matches.iter().zip(inliers).filter(|(_, is_inlier)| **is_inlier).map(|(m, _)| *m)
}

impl Input {
    fn rays(&self) -> Result<[&Rays; 2], String> {
        let [first, second] = self.images.each_ref().map(|image| image.as_ref().as_ref());
        Ok([first.map_err(Clone::clone)?, second.map_err(Clone::clone)?])
    }

    fn usable(&self) -> Result<Usable, String> {
        let [image1, image2] = self.rays()?;
        let (matches, places) = self.matches.usable(image1, image2)?;
        Ok(Usable { matches, places })
    }

    /// The row of an estimate, or why it is none.
    fn row(
        &self,
        usable: &Usable,
        estimate: &Estimate,
        options: &VerifyOptions,
    ) -> Result<TwoViewGeometry, String> {
        let places = usable.chosen(&estimate.inliers);
        self.check(places.len(), options)?;
        let [image1, image2] = self.rays()?;
        let all = &self.matches.0;
        let pixels: Vec<_> = places
            .iter()
            .map(|&k| [image1.pixels[all[k][0] as usize], image2.pixels[all[k][1] as usize]])
            .collect();
        let inliers = self.inliers(&places);
        let cameras = self.cameras.each_ref();
        if is_watermark(&pixels, cameras, options.watermark) {
            return Ok(TwoViewGeometry::of_pixels(Config::Watermark, inliers));
        }
        if self.is_calibrated || options.uncalibrated == Uncalibrated::Skip {
            let rays: Vec<_> = chosen(&usable.matches, &estimate.inliers).collect();
            return Ok(TwoViewGeometry::calibrated(estimate.model, &estimate.pose, &rays, inliers, cameras));
        }
        self.uncalibrated(usable, estimate, options)
    }

    /// Enough inliers for a row?
    fn check(&self, inliers: usize, options: &VerifyOptions) -> Result<(), String> {
        let (all, needed) = (self.matches.0.len(), options.min_inliers);
        if inliers < needed {
            return Err(format!("found {inliers} inliers, expected at least {needed}"));
        }
        let ratio = inliers as f64 / all.max(1) as f64;
        if ratio < options.min_inlier_ratio {
            let needed = options.min_inlier_ratio;
            return Err(format!(
                "{inliers} of {all} matches are inliers, expected at least the part {needed}"
            ));
        }
        Ok(())
    }

    /// The matches at these places, as a row has them.
    fn inliers(&self, places: &[usize]) -> Matches {
        Matches(places.iter().map(|&place| self.matches.0[place]).collect())
    }

    /// The row where a focal length is a guess: what fits the pixels, beginning with what agrees with the guess.
    fn uncalibrated(
        &self,
        usable: &Usable,
        estimate: &Estimate,
        options: &VerifyOptions,
    ) -> Result<TwoViewGeometry, String> {
        let ks = calibrations(self.cameras.each_ref());
        let [k1, k2] =
            ks.ok_or("the focal length of a fisheye camera is a guess: no matrix fits its pixels")?;
        let pixel = |k: &nalgebra::Matrix3<f64>, ray: &nalgebra::Vector3<f64>| -> Vector2<f64> {
            let y = k * ray;
            y.xy() / y.z
        };
        let pixels: Vec<PixelMatch> =
            usable.matches.iter().map(|m| [pixel(&k1, m.bearing1()), pixel(&k2, m.bearing2())]).collect();
        let (kind, config) = match estimate.model {
            Model::Planar | Model::PureRotation => (Kind::Homography, Config::PlanarOrPanoramic),
            _ => (Kind::Fundamental, Config::Uncalibrated),
        };
        let rays: Vec<_> = chosen(&usable.matches, &estimate.inliers).collect();
        let start = match homography(estimate.model, &estimate.pose, &rays, [k1, k2]) {
            Some(plane) => pixel_fit::near(&plane, &pixels, &estimate.inliers, options.search.threshold),
            None => estimate.inliers.clone(),
        };
        let fitted = pixel_fit::fit(kind, &pixels, &start, options.search.threshold)
            .ok_or("no matrix fits the pixels of the inliers")?;
        let places = usable.chosen(&fitted.inliers);
        self.check(places.len(), options)?;
        let row = TwoViewGeometry::of_pixels(config, self.inliers(&places));
        Ok(match kind {
            Kind::Fundamental => TwoViewGeometry { fundamental: Some(fitted.matrix), ..row },
            Kind::Homography => TwoViewGeometry { homography: Some(fitted.matrix), ..row },
        })
    }
}
