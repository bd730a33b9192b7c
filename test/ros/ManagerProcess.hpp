#pragma once

#include <ros/network.h>
#include <ros/ros.h>
#include <xmlrpcpp/XmlRpcClient.h>

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <string>

namespace disparity_refinement {

/// Process of a node; 0 if it does not answer.
inline int pidOf(const std::string& node) {
  XmlRpc::XmlRpcValue request, response, uri;
  request[0] = ros::this_node::getName();
  request[1] = node;
  if (!ros::master::execute("lookupNode", request, response, uri, false)) return 0;
  std::string host;
  std::uint32_t port = 0;
  if (!ros::network::splitURI(uri, host, port)) return 0;
  XmlRpc::XmlRpcClient client(host.c_str(), static_cast<int>(port), "/");
  XmlRpc::XmlRpcValue caller, result;
  caller[0] = ros::this_node::getName();
  if (!client.execute("getPid", caller, result) || result.getType() != XmlRpc::XmlRpcValue::TypeArray ||
      result.size() != 3) {
    return 0;
  }
  return static_cast<int>(result[2]);
}

/// What a process holds.
struct ProcessSize {
  int threads = 0, files = 0;  ///< Files and sockets.
  long memory = 0;             ///< In main memory [kB].
};

inline ProcessSize sizeOf(int pid) {
  const std::string folder = "/proc/" + std::to_string(pid);
  ProcessSize size;
  std::ifstream status(folder + "/status");
  for (std::string word; status >> word;) {
    if (word == "Threads:") status >> size.threads;
    if (word == "VmRSS:") status >> size.memory;
  }
  for (const auto& file : std::filesystem::directory_iterator(folder + "/fd")) {
    static_cast<void>(file);
    ++size.files;
  }
  return size;
}

}  // namespace disparity_refinement
