#pragma once
// Which labels a map has where: counts of (true label, found label), and the figures made of them.
//
// A place whose found label is 0 (none) counts against its true class: a map that says nothing is not right.
// Places whose true label is 0 count nowhere. Intersection over union of class c: places of c found as c,
// over places that are c or found as c (Everingham et al., IJCV 2010, section 4.3).

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
  /// With that true label.
  [[nodiscard]] std::uint64_t places(std::uint8_t truth) const;
  /// With any true label.
  [[nodiscard]] std::uint64_t places() const;
  /// Found right, of all with a true label; 0 without any.
  [[nodiscard]] double accuracy() const;
  /// 0 for a class that neither is nor was found.
  [[nodiscard]] double intersectionOverUnion(std::uint8_t label) const;
  /// Over the classes that hold at least `least_share` of the places.
  [[nodiscard]] double meanIntersectionOverUnion(double least_share) const;
  /// True labels that occur, in their order.
  [[nodiscard]] std::vector<std::uint8_t> classes(double least_share = 0) const;

 private:
  static std::size_t index(std::uint8_t truth, std::uint8_t found) {
    return static_cast<std::size_t>(truth) * kClasses + found;
  }
  std::vector<std::uint64_t> counts_;
};

}  // namespace swiftlet
