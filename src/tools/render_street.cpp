#include <cmath>
#include <filesystem>
#include <iostream>

#include "BagWriter.hpp"
#include "BenchmarkWriter.hpp"
#include "CommandLine.hpp"
#include "disparity_refinement/arguments.hpp"
#include "disparity_refinement/evaluation/SyntheticStreet.hpp"

namespace disparity_refinement {
namespace {

constexpr const char* USAGE =
    R"(Usage: render_street OUTPUT [options]

Renders a drive through a synthetic street. OUTPUT is
  FILE.bag   a bag with NAMESPACE/{left,right}/image_rect and camera_info, and the exact
             disparities as NAMESPACE/ground_truth/disparity
  FOLDER     a new folder in the layout of KITTI's stereo 2012 benchmark, for evaluate
)";

constexpr double FIRST_STAMP = 1e9;  // [s]; any fixed time but 0, which ROS takes for "unknown"

struct Drive {
  StreetParameters street;
  int frames = 30;
  double rate = SyntheticStreet::FRAME_RATE;  ///< Frames per second of the bag
  std::string name_space = "stereo";
};

/// Renders the frames one after the other.
template <class Write>
void render(const Drive& drive, const Write& write) {
  const SyntheticStreet street(drive.street);
  const double f = drive.street.focal_length, fb = f * drive.street.baseline;
  const cv::Point2d c = street.principalPoint();
  const ProjectionMatrix left{f, 0, c.x, 0, 0, f, c.y, 0, 0, 0, 1, 0};
  const ProjectionMatrix right{f, 0, c.x, -fb, 0, f, c.y, 0, 0, 0, 1, 0};
  ProgressLine progress;
  for (int i = 0; i < drive.frames; ++i) {
    write(i, street.render(i), left, right);
    progress.show(i + 1, drive.frames);
  }
}

void renderBag(const Drive& drive, const std::string& output, bool overwrite) {
  BagWriter bag(output, drive.name_space, overwrite);
  render(drive, [&](int i, const StreetFrame& rendered, const ProjectionMatrix& left,
                    const ProjectionMatrix& right) {
    BagFrame frame;
    frame.left = rendered.left;
    frame.right = rendered.right;
    frame.disparity = rendered.disparity;
    frame.left_projection = left;
    frame.right_projection = right;
    frame.left_stamp = frame.right_stamp = std::llround((FIRST_STAMP + i / drive.rate) * 1e9);
    bag.write(frame);
  });
  bag.finish();
}

void renderFolder(const Drive& drive, const std::string& output) {
  SyntheticStreet(drive.street);  // throws before there is a folder
  BenchmarkWriter folder(output);
  render(drive,
         [&](int, const StreetFrame& rendered, const ProjectionMatrix& left, const ProjectionMatrix& right) {
           folder.write(rendered.left, rendered.right, rendered.disparity, left, right);
         });
}

}  // namespace
}  // namespace disparity_refinement

int main(int argc, char** argv) {
  namespace po = boost::program_options;
  using namespace disparity_refinement;
  return runTool("render_street", [&] {
    Drive drive;
    StreetParameters& street_parameters = drive.street;
    po::options_description description("Options");
    description.add_options()("frames", po::value(&drive.frames)->default_value(drive.frames),
                              "number of frames")("rate", po::value(&drive.rate)->default_value(drive.rate),
                                                  "frames per second of the bag")(
        "width", po::value(&street_parameters.width)->default_value(street_parameters.width),
        "of the images [px]")("height",
                              po::value(&street_parameters.height)->default_value(street_parameters.height),
                              "of the images [px]")(
        "focal-length", po::value(&street_parameters.focal_length), "[px], default 0.625 * width")(
        "baseline", po::value(&street_parameters.baseline)->default_value(street_parameters.baseline), "[m]")(
        "noise", po::value(&street_parameters.noise)->default_value(street_parameters.noise),
        "standard deviation of the image noise [gray levels]")(
        "seed", po::value(&street_parameters.seed)->default_value(street_parameters.seed), "another street")(
        "namespace", po::value(&drive.name_space)->default_value(drive.name_space), "of the topics")(
        "force", "overwrite FILE.bag");
    po::variables_map values;
    if (!parseCommandLine(argc, argv, USAGE, {"OUTPUT"}, description, values)) return;
    const std::string output = values["OUTPUT"].as<std::string>();
    requireArgument(drive.frames >= 1, "frames", drive.frames, "at least 1");
    requireArgument(drive.rate > 0.0 && std::isfinite(drive.rate), "rate", drive.rate, "a positive number");
    if (values.count("focal-length") == 0) street_parameters.focal_length = 0.625 * street_parameters.width;

    const bool is_bag = std::filesystem::path(output).extension() == ".bag";
    if (is_bag) {
      renderBag(drive, output, values.count("force") != 0);
    } else {
      renderFolder(drive, output);
    }
    std::cout << output << ": " << drive.frames << " stereo frames\n";
  });
}
