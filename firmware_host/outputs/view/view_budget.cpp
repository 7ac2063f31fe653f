#include "firmware_host/outputs/view/view_budget.hpp"

#include <algorithm>

namespace swiftlet {
namespace {

constexpr double kLeastTaken = 0.5;
constexpr int kLeftOutOf = 3;  // share 1/3; a map's surface, every 3 s, displaces some images at any level

}  // namespace

void ViewBudget::spend(std::size_t bytes) {
  account_ -= static_cast<double>(bytes);
  spent_ += bytes;
}

void ViewBudget::spendOnImages(std::size_t bytes) {
  spend(bytes);
  on_images_ += bytes;
}

bool ViewBudget::mayShow(double now) {
  if (filled_ >= 0) account_ = std::min(kBurst, account_ + kRate * (now - filled_));
  filled_ = now;
  ++offered_;
  if (account_ > 0) return true;
  ++left_out_;
  return false;
}

void ViewBudget::look(double now, double taken) {
  const double seconds = now - looked_;
  const double others = static_cast<double>(spent_ - on_images_) / seconds;
  const double images = static_cast<double>(on_images_) / seconds;
  if ((left_out_ > 0 && left_out_ * kLeftOutOf >= offered_) || taken < kLeastTaken) {
    level_ = std::min(level_ + 1, kLevels.size() - 1);
    up_from_ = now + kPause;
  } else if (level_ > 0 && on_images_ > 0 && now >= up_from_ && others + kGrowth * images < kRate) {
    --level_;
  }
  looked_ = now;
  spent_ = on_images_ = 0;
  offered_ = left_out_ = 0;
}

}  // namespace swiftlet
