#![no_main]
//! Cameras with any parameters: an error, or rays on the plane z = 1 or of length 1 that lead back to their pixels.
use libfuzzer_sys::fuzz_target;
use quest_core::{Camera, CameraModel};
use quest_fuzz::Bytes;
use quest_fuzz::hostile::Choices;

fuzz_target!(|bytes: &[u8]| {
    let mut bytes = Bytes(bytes);
    let model = bytes.pick(&CameraModel::ALL);
    let is_sane = bytes.unit() < 0.7;
    let count = model.param_names().len();
    let params: Vec<f64> = (0..count)
        .map(|k| match (is_sane, k) {
            (false, _) => bytes.anything(),
            (true, 0..4) => bytes.between(100.0, 2000.0),
            (true, _) => bytes.between(-0.3, 0.3),
        })
        .collect();
    let Ok(camera) = Camera::new(model, &params) else { return };
    for _ in 0..4 {
        let pixel = [bytes.between(-1000.0, 3000.0), bytes.between(-1000.0, 3000.0)];
        let Ok(ray) = camera.bearing(pixel) else { continue };
        assert!(ray.z == 1.0 || (ray.norm() - 1.0).abs() < 1e-9, "{camera:?} {pixel:?} {ray:?}");
        let Ok(back) = camera.project(&ray) else { continue };
        let off = if model == CameraModel::Equirectangular {
            // Both sides of a panorama are one direction, and so is the whole row of a pole: directions are compared.
            let Ok(again) = camera.bearing(back) else { panic!("{camera:?}: no ray of {back:?}") };
            ray.angle(&again) * params[0] / std::f64::consts::TAU
        } else {
            (back[0] - pixel[0]).hypot(back[1] - pixel[1])
        };
        // Rounding of the ray in pixels of the largest focal length, times what the distortion stretches.
        assert!(!is_sane || off < 1e-3, "{camera:?} {pixel:?}: off by {off}");
    }
});
