#include "firmware_host/realtime/progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>

#include "firmware_host/realtime/console.hpp"
#include "firmware_host/realtime/stage_timer.hpp"

namespace swiftlet {
namespace {

constexpr double kRedrawSeconds = 0.1;
constexpr std::size_t kBarWidth = 30;

}  // namespace

Progress::Progress(std::string what, std::uint64_t total)
    : what_(std::move(what)), total_(total), terminal_(isatty(STDERR_FILENO) == 1), start_(wallSeconds()) {}

void Progress::update(std::uint64_t done) {
  if (total_ == 0) return;
  const double share = std::min(1.0, static_cast<double>(done) / static_cast<double>(total_));
  if (!terminal_) {
    const std::uint64_t tenths = std::min<std::uint64_t>(10, done * 10 / total_);
    if (tenths <= tenths_said_) return;
    tenths_said_ = tenths;
    warn(fmt::format("{} {} %\n", what_, tenths * 10));
    return;
  }
  const double now = wallSeconds();
  if (now - last_drawn_ < kRedrawSeconds && done < total_) return;
  last_drawn_ = now;
  const double left = share > 0 ? (now - start_) * (1 - share) / share : 0;
  const auto filled = static_cast<std::size_t>(share * kBarWidth);
  warn(fmt::format("\r{} [{:=<{}}{: <{}}] {:3.0f} %  {:.0f} s left ", what_, "", filled, "",
                   kBarWidth - filled, 100 * share, left));
}

void Progress::finish() {
  if (terminal_ && last_drawn_ > 0) warn("\n");
}

}  // namespace swiftlet
