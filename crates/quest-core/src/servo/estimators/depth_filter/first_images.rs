//! The mean of the first images.

/// The places of the features in the first images, until there are enough to average them.
#[derive(Clone, Debug)]
pub(crate) struct FirstImages {
    /// For each feature, how many places are set in a list that is long enough for all.
    places: Vec<(usize, Vec<[f64; 2]>)>,
    seen: usize,
    wanted: usize,
}

impl FirstImages {
    pub(crate) fn new(features: usize, images: usize) -> Self {
        let wanted = images.max(1);
        Self { places: vec![(0, vec![[0.0; 2]; wanted]); features], seen: 0, wanted }
    }

    /// Forgets the images so far.
    pub(crate) fn clear(&mut self) {
        self.places.iter_mut().for_each(|(count, _)| *count = 0);
        self.seen = 0;
    }

    /// Adds an image. With the last of them it becomes the mean of all, and true is returned.
    ///
    /// The mean is taken over a feature's places within `reach` of their median. The feature must be seen in more than half of the images.
    pub(crate) fn average(&mut self, image: &mut [Option<[f64; 2]>], reach: f64) -> bool {
        for ((count, places), seen) in self.places.iter_mut().zip(&*image) {
            if let (Some(seen), Some(place)) = (seen, places.get_mut(*count)) {
                (*place, *count) = (*seen, *count + 1);
            }
        }
        self.seen += 1;
        if self.seen < self.wanted {
            return false;
        }
        for (seen, (count, places)) in image.iter_mut().zip(&mut self.places) {
            let found = std::mem::take(count);
            *seen = mean_around_median(&mut places[..found], reach).filter(|_| 2 * found > self.seen);
        }
        self.seen = 0;
        true
    }
}

/// The mean of the places that are not further than `reach` from their median, in each coordinate: a false match in some of the
/// images does not disturb it.
fn mean_around_median(places: &mut [[f64; 2]], reach: f64) -> Option<[f64; 2]> {
    let middle = places.len() / 2;
    let mut mean = [0.0; 2];
    for (k, mean) in mean.iter_mut().enumerate() {
        places.sort_unstable_by(|a, b| a[k].total_cmp(&b[k]));
        let median = places.get(middle)?[k];
        let near = places.iter().map(|p| p[k]).filter(|c| (c - median).abs() <= reach);
        let (sum, count) = near.fold((0.0, 0.0), |(sum, count), c| (sum + c, count + 1.0));
        *mean = sum / count;
    }
    Some(mean)
}
