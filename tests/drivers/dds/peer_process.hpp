#pragma once
// A program of another DDS as a process: ended by closing its input, killed, or stopped.

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <catch2/catch.hpp>
#include <cstdint>
#include <string>
#include <vector>

namespace swiftlet::test {

/// Two of these tests at once do not hear each other.
inline std::uint32_t ownDomain() {
  static const pid_t kMaker = getpid();
  return 40 + static_cast<std::uint32_t>(kMaker % 30) * 2;
}

class PeerProcess {
 public:
  PeerProcess(const std::string& program, const std::vector<std::string>& arguments) {
    int in[2];
    int out[2];
    // Not inherited: or a process started later would hold this one's input open.
    REQUIRE(pipe2(in, O_CLOEXEC) == 0);
    REQUIRE(pipe2(out, O_CLOEXEC) == 0);
    std::vector<char*> argv = {const_cast<char*>(program.c_str())};
    for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
    argv.push_back(nullptr);
    pid_ = fork();
    REQUIRE(pid_ >= 0);
    if (pid_ == 0) {
      dup2(in[0], STDIN_FILENO);
      dup2(out[1], STDOUT_FILENO);
      execv(program.c_str(), argv.data());
      _exit(127);
    }
    close(in[0]);
    close(out[1]);
    in_ = in[1];
    out_ = out[0];
  }
  ~PeerProcess() {
    if (pid_ > 0) kill(SIGKILL);
    if (in_ >= 0) close(in_);
    close(out_);
  }
  PeerProcess(const PeerProcess&) = delete;
  PeerProcess& operator=(const PeerProcess&) = delete;

  void signal(int number) const { ::kill(pid_, number); }
  void kill(int number) {
    ::kill(pid_, number);
    waitpid(pid_, nullptr, 0);
    pid_ = -1;
  }
  /// What it printed that was not read yet, without waiting.
  std::string poll() {
    fcntl(out_, F_SETFL, O_NONBLOCK);
    return drain();
  }
  /// Ends it; the rest of what it printed.
  std::string finish() {
    close(in_);
    in_ = -1;
    fcntl(out_, F_SETFL, 0);
    const std::string text = drain();
    waitpid(pid_, nullptr, 0);
    pid_ = -1;
    return text;
  }

 private:
  std::string drain() const {
    std::string text;
    std::array<char, 4096> buffer{};
    for (ssize_t n = 0; (n = read(out_, buffer.data(), buffer.size())) > 0;) {
      text.append(buffer.data(), static_cast<std::size_t>(n));
    }
    return text;
  }

  pid_t pid_ = -1;
  int in_ = -1;
  int out_ = -1;
};

}  // namespace swiftlet::test
