#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>

#include "disparity_refinement/ros/StageMonitor.hpp"

namespace disparity_refinement {

/// Processes frames one after the other on a thread of its own.
///
/// The nodelet's callbacks only push, so messages are received while a frame is computed and nothing waits
/// unseen in a queue of roscpp. When the queue is full the oldest frame is dropped and counted: latency stays
/// bounded. An exception that leaves `process` is reported and the next frame is processed; it would
/// otherwise end the manager and every nodelet in it.
template <class Frame>
class FrameWorker {
 public:
  using Process = std::function<void(const Frame&)>;
  using Delay = std::function<double()>;

  /// @param delay  How long to wait before the next frame is taken [s], 0: no longer. Asked again after that
  ///               time and after wake(). Newer frames take the place of the waiting ones meanwhile.
  FrameWorker(
      std::size_t queue_size, StageMonitor& monitor, Process process, Delay delay = [] { return 0.0; })
      : queue_size_(queue_size),
        monitor_(monitor),
        process_(std::move(process)),
        delay_(std::move(delay)),
        thread_([this] { run(); }) {}

  /// Ends after the frame at work.
  ~FrameWorker() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stop_ = true;
    }
    wake_.notify_one();
    thread_.join();
  }

  FrameWorker(const FrameWorker&) = delete;
  FrameWorker& operator=(const FrameWorker&) = delete;

  void push(Frame frame) {
    monitor_.received();
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (queue_.size() >= queue_size_) {
        queue_.pop_front();
        monitor_.dropped(DropReason::QUEUE_FULL);
      }
      queue_.push_back(std::move(frame));
    }
    wake_.notify_one();
  }

  /// The delay may be over.
  void wake() {
    // Not between the worker's question and its wait.
    { const std::lock_guard<std::mutex> lock(mutex_); }
    wake_.notify_one();
  }

 private:
  void run() {
    std::unique_lock<std::mutex> lock(mutex_);
    while (true) {
      wake_.wait(lock, [this] { return stop_ || !queue_.empty(); });
      if (stop_) return;
      if (const double delay = delay_(); delay > 0.0) {
        wake_.wait_for(lock, std::chrono::duration<double>(delay));
        continue;
      }
      {
        const Frame frame = std::move(queue_.front());
        queue_.pop_front();
        lock.unlock();
        try {
          process_(frame);
        } catch (const std::exception& e) {
          refuse(e.what());
        } catch (...) {
          refuse("unknown exception");
        }
      }
      lock.lock();
    }
  }

  void refuse(const char* reason) {
    monitor_.error(reason);
    monitor_.dropped(DropReason::BAD);
  }

  const std::size_t queue_size_;
  StageMonitor& monitor_;
  const Process process_;
  const Delay delay_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<Frame> queue_;
  bool stop_ = false;
  std::thread thread_;  // last: it uses the others
};

}  // namespace disparity_refinement
