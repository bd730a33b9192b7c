#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

namespace disparity_refinement {

/// Camera and image quality of the synthetic street.
struct StreetParameters {
  int width = 640;              ///< [px], >= 64
  int height = 240;             ///< [px], >= 48
  double focal_length = 400.0;  ///< [px]
  double baseline = 0.5;        ///< [m]
  double noise = 2.0;           ///< Standard deviation of the image noise [gray levels]; 0: none.
  std::uint32_t seed = 1;       ///< Seed of textures, layout and noise.
};

/// One rectified stereo pair of the street.
struct StreetFrame {
  cv::Mat left, right;  ///< CV_8UC1
  cv::Mat disparity;    ///< Exact disparity of every left pixel [px], CV_32FC1; 0 where the right camera does
                        ///< not see it.
};

/// A street rendered by ray casting: weakly textured road, cast shadows, walls, cars and poles, seen from a
/// car that drives along it. The ground truth is the geometry itself.
class SyntheticStreet {
 public:
  /// Height of the cameras above the road [m]. The road is a plane: d = baseline / CAMERA_HEIGHT * (y - cy).
  static constexpr double CAMERA_HEIGHT = 1.5;
  /// Frames of the drive per second.
  static constexpr double FRAME_RATE = 10.0;

  /// Throws std::invalid_argument for a parameter out of range.
  explicit SyntheticStreet(const StreetParameters& parameters = {});

  const StreetParameters& parameters() const { return parameters_; }

  /// Principal point of both cameras [px].
  cv::Point2d principalPoint() const;

  /// Frame `index` of the drive, index >= 0. The same parameters and index give the same bits.
  StreetFrame render(int index) const;

 private:
  StreetParameters parameters_;
};

}  // namespace disparity_refinement
