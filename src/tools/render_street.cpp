#include <cmath>
#include <iostream>

#include "BagWriter.hpp"
#include "CommandLine.hpp"
#include "disparity_refinement/arguments.hpp"
#include "disparity_refinement/evaluation/SyntheticStreet.hpp"

namespace {

constexpr const char* USAGE =
    R"(Usage: render_street OUTPUT.bag [options]

Renders a drive through a synthetic street to a bag with NAMESPACE/{left,right}/image_rect
and camera_info, and the exact disparities as NAMESPACE/ground_truth/disparity.
)";

constexpr double FIRST_STAMP = 1e9;  // [s]; any fixed time but 0, which ROS takes for "unknown"

}  // namespace

int main(int argc, char** argv) {
  namespace po = boost::program_options;
  using namespace disparity_refinement;
  return runTool("render_street", [&] {
    StreetParameters street_parameters;
    std::string name_space = "stereo";
    int frames = 30;
    double rate = SyntheticStreet::FRAME_RATE;
    po::options_description description("Options");
    description.add_options()("frames", po::value(&frames)->default_value(frames), "number of frames")(
        "rate", po::value(&rate)->default_value(rate), "frames per second of the bag")(
        "width", po::value(&street_parameters.width)->default_value(street_parameters.width),
        "of the images [px]")("height",
                              po::value(&street_parameters.height)->default_value(street_parameters.height),
                              "of the images [px]")(
        "focal-length", po::value(&street_parameters.focal_length), "[px], default 0.625 * width")(
        "baseline", po::value(&street_parameters.baseline)->default_value(street_parameters.baseline), "[m]")(
        "noise", po::value(&street_parameters.noise)->default_value(street_parameters.noise),
        "standard deviation of the image noise [gray levels]")(
        "seed", po::value(&street_parameters.seed)->default_value(street_parameters.seed), "another street")(
        "namespace", po::value(&name_space)->default_value(name_space), "of the topics")(
        "force", "overwrite OUTPUT.bag");
    po::variables_map values;
    if (!parseCommandLine(argc, argv, USAGE, {"OUTPUT.bag"}, description, values)) return;
    const std::string output = values["OUTPUT.bag"].as<std::string>();
    requireArgument(frames >= 1, "frames", frames, "at least 1");
    requireArgument(rate > 0.0 && std::isfinite(rate), "rate", rate, "a positive number");
    if (values.count("focal-length") == 0) street_parameters.focal_length = 0.625 * street_parameters.width;

    const SyntheticStreet street(street_parameters);
    const double f = street_parameters.focal_length, fb = f * street_parameters.baseline;
    const cv::Point2d c = street.principalPoint();
    BagFrame frame;
    frame.left_projection = {f, 0, c.x, 0, 0, f, c.y, 0, 0, 0, 1, 0};
    frame.right_projection = {f, 0, c.x, -fb, 0, f, c.y, 0, 0, 0, 1, 0};
    BagWriter bag(output, name_space, values.count("force") != 0);
    ProgressLine progress;
    for (int i = 0; i < frames; ++i) {
      const StreetFrame rendered = street.render(i);
      frame.left = rendered.left;
      frame.right = rendered.right;
      frame.disparity = rendered.disparity;
      frame.left_stamp = frame.right_stamp = std::llround((FIRST_STAMP + i / rate) * 1e9);
      bag.write(frame);
      progress.show(i + 1, frames);
    }
    bag.finish();
    std::cout << output << ": " << frames << " stereo frames\n";
  });
}
