// How far an image is from its reference: the one implementation of every measure. Images are linear Rec.709 radiance.
// [thesis ch. 2, Performance: RMSE, LMSE, relative error; Andersson et al. 2020: FLIP; Andersson et al. 2021: HDR-FLIP]
//
// Departs from the thesis, whose images lie in [0,1]: radiance has no such range, so
//   RMSE           is divided by the mean of the reference (all counted pixels and channels): scale-invariant;
//   rmse_display   is the thesis' number on images scaled by `exposure` and cut to [0,1];
//   LMSE           its printed denominator, the plain sum of ∇F, is a sum of Laplacians that cancels; here it is the
//   sum
//                  of the reference's squared ∇F, the usual Laplacian mean squared error. Scale-invariant;
//   relative error divides by max(reference, floor), floor = .001 of the reference's mean (so black pixels do not count
//                  infinitely): of luminance for mean_relative_error and p99, of every channel for the thesis' own.
// Pixels that are not finite in either image are counted in `bad_pixels` and left out of all measures.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace lumicut {

// Interleaved RGB, rows from the top. Measures throw Error naming sizes unless pixels.size() == 3·width·height > 0.
struct RgbImage {
  std::span<const float> pixels;
  uint32_t width = 0, height = 0;
};

struct MetricOptions {
  // Pixels whose reference luminance is at least this are ignored (directly visible lights).
  float ignore_above = std::numeric_limits<float>::infinity();
  // Factor from radiance to [0,1] for rmse_display, FLIP and error images; 0: auto_exposure of the reference.
  float exposure = 0.0f;
  // FLIP's viewing condition: a 0.7 m wide display of 3840 pixels seen from 0.7 m. [Andersson et al. 2020, sec. 4.1]
  float pixels_per_degree = 67.020643f;
  bool flip = true;
  bool hdr_flip = false;  // takes FLIP's time once a stop of the reference's range
};

struct Metrics {
  uint64_t pixels = 0;        // counted
  uint64_t ignored = 0;       // by ignore_above
  uint64_t bad_pixels = 0;    // NaN or infinite in one of the images
  double reference_mean = 0;  // of all counted pixels and channels
  double exposure = 0;        // used for the display-referred measures
  double rmse = 0;            // sqrt(mean (F - R)²) / reference_mean
  double rmse_absolute = 0;   // in radiance
  double rmse_display = 0;
  double lmse = 0;  // Σ(∇F - ∇R)² / Σ(∇R)², over pixels whose four neighbours count
  // Fractions (0.02 is 2 %), of luminance: |F - R| / max(R, floor).
  double mean_relative_error = 0, p95_relative_error = 0, p99_relative_error = 0, max_relative_error = 0;
  double mean_relative_error_channels = 0;  // the thesis': over every colour channel
  double mrse = 0;                          // mean of squared relative errors of luminance
  double smape = 0;                         // mean |F - R| / (|F| + |R|) of luminance, 0..1; 0 where both are 0
  double bias = 0;                          // mean (F - R) / mean R of luminance: > 0 is too bright
  double flip = 0;                          // mean LDR-FLIP of the exposed images, 0..1
  double hdr_flip = 0;                      // mean HDR-FLIP, 0..1
};

// Throws Error when the sizes differ or no pixel counts.
Metrics compare_images(const RgbImage& image, const RgbImage& reference, const MetricOptions& options = {});

// Exposure that brings the geometric mean of the luminances that are finite and above 1e-6 of the greatest to 0.18,
// middle grey; 1 for black images.
float auto_exposure(const RgbImage& image);

// exposure·radiance, cut to [0,1], coded as sRGB in 8 bits. NaN is shown as magenta.
std::vector<uint8_t> to_srgb8(const RgbImage& image, float exposure);

// Channel-wise Euclidean distance of the exposed images times `scale`, grey, cut to [0,1]. [thesis ch. 2: x16, x32]
// One value a pixel; 1 where either image is not finite.
std::vector<float> error_image(const RgbImage& image, const RgbImage& reference, float exposure, float scale);

// (F - R) / max(R, floor) of luminance, signed: > 0 is too bright; the floor as above, over all finite pixels. One
// value a pixel; NaN where either image is not finite. Its magnitude is what mean_relative_error averages.
std::vector<float> relative_error_image(const RgbImage& image, const RgbImage& reference);

// LDR-FLIP of two images of linear RGB, cut to [0,1] here; one value in [0,1] a pixel. [Andersson et al. 2020]
// HDR images are exposed first: this is LDR-FLIP at one exposure.
std::vector<float> flip_image(const RgbImage& image, const RgbImage& reference, float pixels_per_degree);

// HDR-FLIP: the greatest LDR-FLIP of the images under the ACES curve, over exposures that bring the reference's brightest
// pixel and its median to .85, and those between, about a stop apart. [Andersson et al. 2021, Eq. 1-4]
struct HdrFlip {
  std::vector<float> image;    // one value in [0,1] a pixel
  double start = 0, stop = 0;  // stops (log2 of the factor)
  int exposures = 0;
};
HdrFlip hdr_flip_image(const RgbImage& image, const RgbImage& reference, float pixels_per_degree);

}  // namespace lumicut
