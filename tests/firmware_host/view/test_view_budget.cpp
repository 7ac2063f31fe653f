// What the live view sends in a second, and how its images' size follows.

#include <algorithm>
#include <catch2/catch.hpp>
#include <deque>

#include "firmware_host/outputs/view/view_budget.hpp"

namespace swiftlet {
namespace {

/// A view that offers images 20 times a second, of `full` bytes at the best level.
struct Sender {
  ViewBudget budget;
  double now = 1000;
  double taken = 1;
  std::deque<std::pair<double, double>> sent;
  double most = 0;  ///< bytes in any second
  int shown = 0;

  void run(double seconds, double full, double patch = 40e3) {
    for (int i = 0; i < static_cast<int>(20 * seconds); ++i, now += 0.05) {
      budget.adapt(now, [this] { return taken; });
      if (budget.mayShow(now)) {
        double bytes = full;
        for (std::size_t l = 0; l < budget.level(); ++l) bytes /= ViewBudget::kGrowth;
        budget.spendOnImages(static_cast<std::size_t>(bytes));
        note(bytes);
        ++shown;
      }
      if (i % 4 == 0) {
        budget.spend(static_cast<std::size_t>(patch));
        note(patch);
      }
      // A map's surface.
      if (i % 60 == 0) {
        budget.spend(450'000);
        note(450e3);
      }
    }
  }
  void note(double bytes) {
    sent.emplace_back(now, bytes);
    while (sent.front().first <= now - 1) sent.pop_front();
    double sum = 0;
    for (const auto& one : sent) sum += one.second;
    most = std::max(most, sum);
  }
};

TEST_CASE("in no second more is sent than 3 MB, whatever the images' size") {
  for (const double full : {10e3, 60e3, 90e3, 150e3, 400e3, 900e3}) {
    CAPTURE(full);
    Sender sender;
    sender.run(60, full);
    CHECK(sender.most <= ViewBudget::kMostBytes);
    CHECK(sender.shown > 60);
  }
}

TEST_CASE("small images come at full size and rate, large ones smaller") {
  Sender small;
  small.run(20, 60e3);
  CHECK(small.budget.level() == 0);
  CHECK(small.shown > 370);  // some wait for a map's surface
  Sender large;
  large.run(20, 800e3);
  CHECK(large.budget.level() > 1);
  CHECK(large.shown > 200);
}

TEST_CASE("where no viewer takes half of the images they become smaller, and larger again once one does") {
  Sender sender;
  sender.taken = 0.3;
  sender.run(10, 60e3);
  CHECK(sender.budget.level() == ViewBudget::kLevels.size() - 1);
  sender.taken = 1;
  sender.run(30, 60e3);
  CHECK(sender.budget.level() == 0);
}

}  // namespace
}  // namespace swiftlet
