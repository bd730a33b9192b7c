#pragma once

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <stdexcept>
#include <string>
#include <vector>

namespace disparity_refinement {

/// A program that runs beside the test, and ends with it at the latest.
class ChildProcess {
 public:
  /// What it writes to stdout and stderr goes to the file `log`, unless that is empty.
  explicit ChildProcess(const std::vector<std::string>& command, const std::string& log = "") : pid_(fork()) {
    if (pid_ < 0) throw std::runtime_error("fork");
    if (pid_ > 0) return;
    // A group of its own, so that its children end with it.
    setpgid(0, 0);
    if (!log.empty()) {
      const int file = open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
      dup2(file, STDOUT_FILENO);
      dup2(file, STDERR_FILENO);
    }
    std::vector<char*> arguments;
    for (const std::string& argument : command) arguments.push_back(const_cast<char*>(argument.c_str()));
    arguments.push_back(nullptr);
    execvp(arguments[0], arguments.data());
    _exit(127);
  }

  ~ChildProcess() {
    if (!isRunning()) return;
    kill(-pid_, SIGKILL);
    waitpid(pid_, &status_, 0);
  }

  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  bool isRunning() {
    if (is_running_ && waitpid(pid_, &status_, WNOHANG) == pid_) is_running_ = false;
    return is_running_;
  }

  /// Of a program that has ended; -1 if a signal ended it.
  int exitCode() const { return WIFEXITED(status_) ? WEXITSTATUS(status_) : -1; }

 private:
  const pid_t pid_;
  bool is_running_ = true;
  int status_ = 0;
};

}  // namespace disparity_refinement
