#include <iostream>

#include "CommandLine.hpp"
#include "KittiToBag.hpp"

namespace {

constexpr const char* USAGE =
    R"(Usage: kitti_to_bag INPUT OUTPUT.bag [options]

Converts rectified KITTI stereo images to a bag with NAMESPACE/{left,right}/image_rect
and camera_info. INPUT is one of these folders:
  odometry sequence   image_0, image_1, calib.txt, times.txt
  raw "sync" drive    image_00, image_01; calib_cam_to_cam.txt inside or one level up
  stereo benchmark    image_0, image_1 (*_10.png), calib; disp_noc or disp_occ become
                      NAMESPACE/ground_truth/disparity
)";

}  // namespace

int main(int argc, char** argv) {
  namespace po = boost::program_options;
  using namespace disparity_refinement;
  return runTool("kitti_to_bag", [&] {
    KittiToBagOptions options;
    po::options_description description("Options");
    description.add_options()("color", "take the colour cameras 2 and 3, as image_rect_color")(
        "namespace", po::value(&options.name_space)->default_value(options.name_space), "of the topics")(
        "start", po::value(&options.start)->default_value(options.start), "first frame")(
        "frames", po::value(&options.frames)->default_value(options.frames), "number of frames, 0: all")(
        "rate", po::value(&options.rate)->default_value(options.rate),
        "frames per second of a stereo benchmark folder, 0.001 ... 1000000")(
        "original-stamps",
        "give the right images of a raw drive their own times instead of the left ones: needs "
        "approximate synchronization")("force", "overwrite OUTPUT.bag");
    po::variables_map values;
    if (!parseCommandLine(argc, argv, USAGE, {"INPUT", "OUTPUT.bag"}, description, values)) return;
    options.input = values["INPUT"].as<std::string>();
    options.output = values["OUTPUT.bag"].as<std::string>();
    options.cameras = values.count("color") != 0 ? KittiCameras::COLOR : KittiCameras::GRAY;
    options.original_stamps = values.count("original-stamps") != 0;
    options.overwrite = values.count("force") != 0;

    ProgressLine progress;
    const int frames = convertKitti(options, [&](int done, int total) { progress.show(done, total); });
    std::cout << options.output << ": " << frames << " stereo frames\n";
  });
}
