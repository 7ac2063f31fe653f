#pragma once
// Confusion of a map's labels: counts of (true label, found label), and figures derived from them.
//
// A place without a found label (0) counts against its true class. Places whose true label is 0 are not
// counted. Intersection over union of class c: places of c found as c, divided by places that are c or were
// found as c (Everingham et al., IJCV 2010, section 4.3).

#include <array>
#include <cstdint>
#include <vector>

namespace swiftlet {

class LabelConfusion {
 public:
  static constexpr std::size_t kClasses = 256;

  LabelConfusion() : counts_(kClasses * kClasses) {}

  void add(std::uint8_t truth, std::uint8_t found) { ++counts_[index(truth, found)]; }
  void add(const LabelConfusion& other);

  [[nodiscard]] std::uint64_t count(std::uint8_t truth, std::uint8_t found) const {
    return counts_[index(truth, found)];
  }
  /// Places with this true label.
  [[nodiscard]] std::uint64_t places(std::uint8_t truth) const;
  /// Places with any true label.
  [[nodiscard]] std::uint64_t places() const;
  /// Share of correctly found labels among places with a true label; 0 without any.
  [[nodiscard]] double accuracy() const;
  /// 0 for a class that neither exists nor was found.
  [[nodiscard]] double intersectionOverUnion(std::uint8_t label) const;
  /// Over the classes with at least `least_share` of the places.
  [[nodiscard]] double meanIntersectionOverUnion(double least_share) const;
  /// True labels that occur, in ascending order.
  [[nodiscard]] std::vector<std::uint8_t> classes(double least_share = 0) const;

 private:
  static std::size_t index(std::uint8_t truth, std::uint8_t found) {
    return static_cast<std::size_t>(truth) * kClasses + found;
  }
  std::vector<std::uint64_t> counts_;
};

}  // namespace swiftlet
