// The bridge to ROS without a master: images, disparity images and camera infos with any fields, and the way
// of a frame through the refining nodelet.

#include <boost/make_shared.hpp>
#include <string>

#include "Input.hpp"
#include "disparity_refinement/refinement/DisparityRefinement.hpp"
#include "disparity_refinement/ros/Messages.hpp"
#include "disparity_refinement/ros/PlaneMarkers.hpp"
#include "disparity_refinement/ros/StereoGeometry.hpp"
#include "disparity_refinement/visualization/Colorize.hpp"
#include "disparity_refinement/visualization/PlanePatches.hpp"

namespace disparity_refinement {
namespace fuzz {
namespace {

namespace enc = sensor_msgs::image_encodings;

constexpr const char* TOPIC = "/camera/left/image_rect";

std::string encodingOf(Input& input) {
  if (input.oneIn(4)) return input.text(16);
  return input.oneOf<std::string>(
      {enc::MONO8,       enc::MONO16,       enc::BGR8,         enc::RGB8,        enc::BGRA8,
       enc::RGBA8,       enc::BGR16,        enc::RGBA16,       enc::TYPE_8UC1,   enc::TYPE_8UC2,
       enc::TYPE_8SC1,   enc::TYPE_16UC1,   enc::TYPE_16SC1,   enc::TYPE_32SC1,  enc::TYPE_32FC1,
       enc::TYPE_64FC1,  enc::TYPE_64FC4,   enc::BAYER_RGGB8,  enc::BAYER_BGGR8, enc::BAYER_GBRG8,
       enc::BAYER_GRBG8, enc::BAYER_RGGB16, enc::BAYER_GRBG16, enc::YUV422,      "8UC",
       "8UC0",           "8UC3x",           "8UC513",          "8UC-1",          "32FC99999999",
       "64FC999999999"});
}

// Width, height, step and amount of data fit to each other, unless the input is wild.
void fillImage(Input& input, sensor_msgs::Image& image, const std::string& encoding, int bytes_per_pixel) {
  const cv::Size size = input.size(24, 16);
  image.width = static_cast<std::uint32_t>(size.width);
  image.height = static_cast<std::uint32_t>(size.height);
  image.encoding = encoding;
  image.is_bigendian = input.oneIn(6) ? input.bytes().ConsumeIntegral<std::uint8_t>() : 0;
  image.step =
      image.width * static_cast<std::uint32_t>(bytes_per_pixel) + (input.oneIn(3) ? input.number(0, 16) : 0);
  std::size_t bytes = static_cast<std::size_t>(image.step) * image.height;
  if (input.isWild()) {
    for (std::uint32_t* field : {&image.width, &image.height, &image.step}) {
      if (input.oneIn(8))
        *field = input.yes() ? input.bytes().ConsumeIntegral<std::uint32_t>() : *field + input.number(-2, 2);
    }
    if (input.oneIn(4)) bytes = static_cast<std::size_t>(input.number(0, 4000));
  }
  image.data.resize(std::min<std::size_t>(bytes, 20000));
  image.data.shrink_to_fit();
  if (image.data.empty()) return;
  cv::Mat row(1, static_cast<int>(image.data.size()), CV_8UC1, image.data.data());
  input.fillGray(row);
}

void testGray(Input& input) {
  const auto message = boost::make_shared<sensor_msgs::Image>();
  fillImage(input, *message, encodingOf(input), input.oneOf({1, 1, 2, 3, 4, 6, 8}));
  cv_bridge::CvImageConstPtr gray;
  if (!succeeds([&] { gray = grayImage(message, TOPIC); }, TOPIC)) return;
  require(gray->image.type() == CV_8UC1, "the image is gray");
  require(gray->image.cols == static_cast<int>(message->width) &&
              gray->image.rows == static_cast<int>(message->height),
          "the image has the size of the message");
  unsigned sum = 0;
  for (int y = 0; y < gray->image.rows; ++y) {
    for (int x = 0; x < gray->image.cols; ++x) sum += gray->image.at<std::uint8_t>(y, x);
  }
  require(sum <= 255U * gray->image.total(), "all pixels can be read");
}

void testInfo(Input& input) {
  sensor_msgs::CameraInfo left, right;
  for (sensor_msgs::CameraInfo* info : {&left, &right}) {
    for (double& entry : info->P) entry = input.oneIn(2) ? 0.0 : input.anyNumber<double>();
    if (input.yes()) info->P[0] = input.parameter(1.0, 5000.0);
    if (input.yes()) info->P[3] = input.parameter(-5000.0, 0.0);
    if (!input.oneIn(3)) continue;
    info->binning_x = input.bytes().ConsumeIntegral<std::uint32_t>();
    info->binning_y = input.bytes().ConsumeIntegral<std::uint32_t>();
    info->roi.x_offset = input.bytes().ConsumeIntegral<std::uint32_t>();
    info->roi.y_offset = input.bytes().ConsumeIntegral<std::uint32_t>();
  }
  StereoGeometry geometry;
  if (!succeeds([&] { geometry = stereoGeometry(left, right); })) return;
  require(geometry.focal_length > 0.0 && std::isfinite(geometry.focal_length), "f is positive");
  require(geometry.baseline > 0.0 && std::isfinite(geometry.baseline), "T is positive");
  require(std::isfinite(geometry.principal_point_offset), "the principal points are known");
}

void requireRefined(const stereo_msgs::DisparityImage& message, const cv::Mat& refined) {
  const float invalid = message.min_disparity - 1.0F;
  bool has_hole = false;
  for (const float d : cv::Mat_<float>(refined)) {
    require((d >= message.min_disparity && d <= message.max_disparity) || d == invalid,
            "every pixel is in the message's range or has its invalid value");
    has_hole = has_hole || d < message.min_disparity;
  }
  require(has_hole, "at least one pixel is invalid");
}

// As the nodelet does it: what the bridge lets pass is refined.
void testDisparity(Input& input) {
  stereo_msgs::DisparityImage in;
  fillImage(input, in.image, input.oneIn(8) ? encodingOf(input) : enc::TYPE_32FC1, 4);
  in.f = input.oneIn(2) ? 400.0F : input.anyNumber<float>();
  in.T = input.oneIn(2) ? 0.5F : input.anyNumber<float>();
  in.min_disparity = input.oneIn(2) ? 0.0F : input.anyNumber<float>();
  in.max_disparity = input.oneIn(2) ? 64.0F : input.anyNumber<float>();
  if (input.oneIn(4) == false) {
    // Instead of any bytes.
    const Picture map = input.disparity({static_cast<int>(in.image.data.size() / 4), 1}, {0.0F, 64.0F});
    if (map.mat().type() == CV_32FC1 && map.mat().rows == 1 &&
        map.mat().total() * 4 <= in.image.data.size() && !map.mat().empty()) {
      std::memcpy(in.image.data.data(), map.mat().data, map.mat().total() * 4);
    }
  }
  cv::Mat disparity;
  DisparityRange range;
  StereoGeometry geometry;
  const bool is_good = succeeds(
      [&] {
        disparity = imageView(in.image, enc::TYPE_32FC1, TOPIC);
        geometry = disparityGeometry(in, TOPIC);
        range = disparityRange(in, TOPIC);
      },
      TOPIC);
  if (!is_good) return;

  const auto out =
      makeDisparityImage(in.header, disparity.size(), geometry, range, {{0, 0}, disparity.size()});
  cv::Mat refined = imageView(out->image, enc::TYPE_32FC1, "refined");
  const std::uint8_t* memory = refined.data;
  RefinementParameters parameters;
  if (input.oneIn(3)) parameters.mode = RefinementMode::QUALITY;
  const cv::Mat gray(disparity.size(), CV_8UC1, cv::Scalar(7));
  cv::Mat labels(disparity.size(), CV_32SC1, cv::Scalar(0));
  labels.colRange(0, labels.cols / 2) = input.number(-1, 1);
  if (labels.total() == 1) labels = 0;
  DisparityRefinement refinement;
  const double f_times_t = geometry.focal_length * geometry.baseline;
  refinement.refine(disparity, labels, gray, range, f_times_t, parameters, refined);
  require(refined.data == memory, "the map is written into the message");
  requireRefined(*out, refined);

  const auto depth = depthImage(in.header, refined, range, geometry);
  for (const float z : cv::Mat_<float>(imageView(*depth, enc::TYPE_32FC1, "depth"))) {
    require(std::isnan(z) || z >= 0.0F, "depths are positive or unknown");
  }
  const auto planes = planesMessage(in.header, refinement.planes());
  require(planes->planes.size() == refinement.planes().size(), "there is a plane for every label");
}

// As the visualization does it: planes and labels that another node may have published.
void testPlanes(Input& input) {
  Planes message;
  message.header.stamp.sec = input.oneIn(2) ? 1 : input.bytes().ConsumeIntegral<std::uint32_t>();
  succeeds([&] { requireTime(message.header, TOPIC); }, TOPIC);
  message.planes.resize(static_cast<std::size_t>(input.number(0, 8)));
  for (Plane& plane : message.planes) {
    plane.status = static_cast<std::uint8_t>(input.parameter(0, 4));
    plane.a = input.oneIn(3) ? input.anyNumber<double>() : input.parameter(-2.0, 2.0);
    plane.b = input.oneIn(3) ? input.anyNumber<double>() : input.parameter(-2.0, 2.0);
    plane.c = input.oneIn(3) ? input.anyNumber<double>() : input.parameter(-10.0, 100.0);
    plane.pixels = input.bytes().ConsumeIntegral<std::uint32_t>();
  }
  std::vector<SegmentPlane> planes;
  if (!succeeds([&] { planes = segmentPlanes(message, TOPIC); }, TOPIC)) return;
  const Picture labels = input.labels(input.size(24, 16));
  const cv::Mat gray(labels.mat().size(), CV_8UC1, cv::Scalar(7));
  cv::Mat picture;
  succeeds([&] { drawRefusedSegments(gray, labels.mat(), planes, picture); });
  StereoGeometry geometry;
  geometry.focal_length = 400.0;
  geometry.baseline = 0.5;
  std::vector<PlanePatch> patches;
  if (!succeeds([&] { patches = findPlanePatches(labels.mat(), planes, geometry, {12.0, 8.0}); })) return;
  const auto markers = planeMarkers(message.header, patches);
  for (const visualization_msgs::Marker& marker : markers->markers) {
    require(marker.points.empty() == patches.empty() && marker.colors.size() == marker.points.size(),
            "markers have points and colours");
    for (const geometry_msgs::Point& point : marker.points) {
      require(std::isfinite(point.x) && std::isfinite(point.y) && std::isfinite(point.z),
              "markers are finite");
    }
  }
}

void testLabels(Input& input) {
  sensor_msgs::Image image;
  const std::string encoding =
      input.oneOf<std::string>({enc::TYPE_32SC1, enc::TYPE_32FC1, enc::MONO8, enc::MONO16});
  fillImage(input, image, input.oneIn(4) ? encodingOf(input) : encoding, input.oneOf({1, 2, 4}));
  cv::Mat view;
  if (!succeeds([&] { view = imageView(image, encoding, TOPIC); }, TOPIC)) return;
  unsigned sum = 0;
  for (int y = 0; y < view.rows; ++y) {
    for (std::size_t i = 0; i < view.cols * view.elemSize(); ++i) sum += view.ptr(y)[i];
  }
  require(sum <= 255U * view.total() * view.elemSize(), "all pixels can be read");
}

}  // namespace

void test(Input& input) {
  switch (input.number(0, 6)) {
    case 0:
    case 1:
      testGray(input);
      break;
    case 2:
      testInfo(input);
      break;
    case 3:
      testLabels(input);
      break;
    case 4:
      testPlanes(input);
      break;
    default:
      testDisparity(input);
  }
}

}  // namespace fuzz
}  // namespace disparity_refinement
