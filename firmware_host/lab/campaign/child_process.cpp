#include "firmware_host/lab/campaign/child_process.hpp"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <thread>

#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

constexpr auto kLook = std::chrono::milliseconds(20);
constexpr auto kPatience = std::chrono::seconds(10);  // time for a run to close its files

/// Runs in the child of a program with threads: only calls that POSIX allows there.
[[noreturn]] void become(char* const* arguments, const char* folder, int output, int failure, pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) _exit(1);
  if (chdir(folder) == 0 && dup2(output, STDOUT_FILENO) >= 0 && dup2(output, STDERR_FILENO) >= 0) {
    execvp(arguments[0], arguments);
  }
  const int error = errno;
  static_cast<void>(!write(failure, &error, sizeof error));
  _exit(127);
}

/// The error that prevented the child from starting; 0: it started, which closes the pipe.
int errorOfStart(int pipe) {
  int error = 0;
  ssize_t got = 0;
  do got = read(pipe, &error, sizeof error);
  while (got < 0 && errno == EINTR);
  return got == sizeof error ? error : 0;
}

ChildEnd waitFor(pid_t child, const std::atomic<bool>& stop) {
  ChildEnd end;
  std::chrono::steady_clock::time_point asked;
  int status = 0;
  for (pid_t ended = 0; (ended = waitpid(child, &status, WNOHANG)) != child;) {
    if (ended < 0 && errno != EINTR) return end;
    const auto now = std::chrono::steady_clock::now();
    if (stop.load(std::memory_order_relaxed) && !end.stopped) {
      end.stopped = true;
      asked = now;
      kill(child, SIGTERM);
    }
    if (end.stopped && now - asked > kPatience) kill(child, SIGKILL);
    std::this_thread::sleep_for(kLook);
  }
  if (WIFEXITED(status)) end.exit_code = WEXITSTATUS(status);
  if (WIFSIGNALED(status)) end.signal = WTERMSIG(status);
  return end;
}

}  // namespace

ChildEnd runChild(const std::vector<std::string>& command, const std::string& folder,
                  const std::string& output, const std::atomic<bool>& stop) {
  const int file = open(output.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  int failure[2];
  if (file < 0 || pipe2(failure, O_CLOEXEC) != 0) {
    const int error = errno;
    if (file >= 0) close(file);
    throw InputError(output, 0, "", std::strerror(error), "Free space, or give another --out folder");
  }
  std::vector<char*> arguments;
  for (const std::string& argument : command) arguments.push_back(const_cast<char*>(argument.c_str()));
  arguments.push_back(nullptr);
  const pid_t parent = getpid();
  const pid_t child = fork();
  if (child == 0) become(arguments.data(), folder.c_str(), file, failure[1], parent);
  int error = child < 0 ? errno : 0;
  close(file);
  close(failure[1]);
  if (child > 0) error = errorOfStart(failure[0]);
  close(failure[0]);
  ChildEnd end;
  if (child > 0) end = waitFor(child, stop);
  end.errno_of_start = error;
  return end;
}

}  // namespace swiftlet
