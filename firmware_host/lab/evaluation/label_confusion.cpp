#include "firmware_host/lab/evaluation/label_confusion.hpp"

namespace swiftlet {
namespace {

double share(std::uint64_t part, std::uint64_t whole) {
  return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
}

constexpr int kLastLabel = static_cast<int>(LabelConfusion::kClasses) - 1;

}  // namespace

void LabelConfusion::add(const LabelConfusion& other) {
  for (std::size_t i = 0; i < counts_.size(); ++i) counts_[i] += other.counts_[i];
}

std::uint64_t LabelConfusion::places(std::uint8_t truth) const {
  std::uint64_t sum = 0;
  for (int found = 0; found <= kLastLabel; ++found) sum += count(truth, static_cast<std::uint8_t>(found));
  return sum;
}

std::uint64_t LabelConfusion::places() const {
  std::uint64_t sum = 0;
  for (int truth = 1; truth <= kLastLabel; ++truth) sum += places(static_cast<std::uint8_t>(truth));
  return sum;
}

double LabelConfusion::accuracy() const {
  std::uint64_t right = 0;
  for (const std::uint8_t label : classes()) right += count(label, label);
  return share(right, places());
}

double LabelConfusion::intersectionOverUnion(std::uint8_t label) const {
  std::uint64_t found = 0;
  for (int truth = 1; truth <= kLastLabel; ++truth) found += count(static_cast<std::uint8_t>(truth), label);
  const std::uint64_t both = count(label, label);
  return share(both, places(label) + found - both);
}

double LabelConfusion::meanIntersectionOverUnion(double least_share) const {
  const std::vector<std::uint8_t> judged = classes(least_share);
  double sum = 0;
  for (const std::uint8_t label : judged) sum += intersectionOverUnion(label);
  return judged.empty() ? 0 : sum / static_cast<double>(judged.size());
}

std::vector<std::uint8_t> LabelConfusion::classes(double least_share) const {
  const std::uint64_t all = places();
  std::vector<std::uint8_t> result;
  for (int truth = 1; truth <= kLastLabel; ++truth) {
    const std::uint64_t own = places(static_cast<std::uint8_t>(truth));
    if (own > 0 && share(own, all) >= least_share) result.push_back(static_cast<std::uint8_t>(truth));
  }
  return result;
}

}  // namespace swiftlet
