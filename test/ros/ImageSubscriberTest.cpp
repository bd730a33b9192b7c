#include <gtest/gtest.h>

#include <atomic>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "ChainClient.hpp"
#include "disparity_refinement/ros/ImageSubscriber.hpp"

namespace disparity_refinement {
namespace {

/// Whether a library of that name is loaded.
bool isLoaded(const std::string& library) {
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) {
    if (line.find(library) != std::string::npos) return true;
  }
  return false;
}

class ImageSubscriberTest : public testing::Test {
 protected:
  ros::NodeHandle nh, private_nh{"~"};
  StageMonitor monitor{"image_subscriber_test", nh, private_nh};
};

TEST_F(ImageSubscriberTest, rawNeedsNoPlugin) {
  ImageSubscriber subscriber;
  subscriber.subscribe(nh, private_nh, "image", 1, monitor, [](const sensor_msgs::ImageConstPtr&) {});
  EXPECT_TRUE(subscriber.isSubscribed());
  ASSERT_TRUE(isLoaded("libimage_transport.so"));
  EXPECT_FALSE(isLoaded("libimage_transport_plugins.so"));
}

TEST_F(ImageSubscriberTest, receivesWhateverThreadsSubscribeAtTheSameTime) {
  ros::Publisher publisher = nh.advertise<sensor_msgs::Image>("image", 1, true);
  sensor_msgs::Image image;
  image.header.stamp = ros::Time(1, 0);
  publisher.publish(image);
  constexpr int THREADS = 8, ROUNDS = 20;
  for (int round = 0; round < ROUNDS; ++round) {
    std::vector<std::unique_ptr<ImageSubscriber>> subscribers;
    for (int i = 0; i < THREADS; ++i) subscribers.push_back(std::make_unique<ImageSubscriber>());
    std::vector<std::atomic<bool>> received(THREADS);
    std::atomic<int> ready{0}, failed{0};
    std::vector<std::thread> threads;
    for (int i = 0; i < THREADS; ++i) {
      threads.emplace_back([&, i] {
        ++ready;
        while (ready < THREADS) std::this_thread::yield();
        try {
          subscribers[i]->subscribe(
              nh, private_nh, "image", 1, monitor,
              [&received, i](const sensor_msgs::ImageConstPtr&) { received[i] = true; });
        } catch (const std::exception& e) {
          ADD_FAILURE() << e.what();
          ++failed;
        }
      });
    }
    for (std::thread& thread : threads) thread.join();
    ASSERT_EQ(failed, 0) << "round " << round;
    for (int i = 0; i < THREADS; ++i) {
      EXPECT_TRUE(subscribers[i]->isSubscribed());
      EXPECT_TRUE(waitFor([&] { return received[i].load(); })) << "subscriber " << i << ", round " << round;
    }
  }
}

TEST_F(ImageSubscriberTest, hearsNothingAfterItsShutdown) {
  ros::Publisher publisher = nh.advertise<sensor_msgs::Image>("image", 1);
  ImageSubscriber subscriber;
  EXPECT_FALSE(subscriber.isSubscribed());
  subscriber.subscribe(nh, private_nh, "image", 1, monitor, [](const sensor_msgs::ImageConstPtr&) {});
  EXPECT_TRUE(waitFor([&] { return publisher.getNumSubscribers() == 1; }));
  subscriber.shutdown();
  EXPECT_FALSE(subscriber.isSubscribed());
  EXPECT_TRUE(waitFor([&] { return publisher.getNumSubscribers() == 0; }));
}

TEST_F(ImageSubscriberTest, refusesATransportThatIsNotInstalled) {
  const ros::NodeHandle private_nh("~unknown");
  private_nh.setParam("image_transport", "carrier_pigeon");
  ImageSubscriber subscriber;
  for (int attempt = 0; attempt < 2; ++attempt) {
    try {
      subscriber.subscribe(nh, private_nh, "image", 1, monitor, [](const sensor_msgs::ImageConstPtr&) {});
      ADD_FAILURE() << "nothing was thrown";
    } catch (const image_transport::TransportLoadException& e) {
      EXPECT_NE(std::string(e.what()).find("carrier_pigeon"), std::string::npos) << e.what();
    }
    EXPECT_FALSE(subscriber.isSubscribed());
  }
}

}  // namespace
}  // namespace disparity_refinement
