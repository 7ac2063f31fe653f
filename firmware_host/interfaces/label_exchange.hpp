#pragma once
// Exchange of images and labels: the map's images go to a labelling network, labels return by stamp.
//
// Two threads. The map's thread opens a place for each frame that it holds and closes it when it maps the
// frame; the other side (ROS 2) shows the image of each open place once and offers labels. Labels are copied
// into the place with exactly their stamp; labels of other stamps cannot replace them. Labels ahead of the
// map's frames (from a network that reads the camera itself) are kept on the other side, the last kEarly of
// them. All others are counted and dropped. Neither side waits for the other: a place that the other side is
// using is not closed, and the map tries again later. Memory: kPlaces images and labels, kEarly labels, of
// camera 0's size. Cost of an offer: one comparison per place if no place matches, else a copy.

#include <array>
#include <atomic>
#include <cstdint>
#include <limits>
#include <vector>

#include "estimator/core/image_view.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

class LabelExchange {
 public:
  static constexpr std::size_t kPlaces = 8;
  static constexpr std::size_t kEarly = 4;

  /// For the other side's thread; for other threads after it has ended.
  struct Counters {
    std::uint64_t shown = 0;       ///< images
    std::uint64_t offered = 0;     ///< labels
    std::uint64_t taken = 0;       ///< copied into a waiting place
    std::uint64_t wrong_size = 0;  ///< size differs from camera 0's
    std::uint64_t unawaited = 0;   ///< too late, or of a frame that is not mapped
  };

  /// Size of camera 0's images. `patience`: how long the map may hold a frame.
  LabelExchange(int width, int height, Duration patience);

  [[nodiscard]] std::int64_t bytes() const;
  [[nodiscard]] Duration patience() const { return patience_; }

  // The map's thread.

  /// Copies `image`, which has this exchange's size, into a free place and returns that place; -1: none is
  /// free.
  int open(Stamp stamp, const ImageView& image);
  /// The place's image; valid until free().
  [[nodiscard]] ImageView image(int place) const { return viewOf(at(place).image); }
  [[nodiscard]] bool isLabelled(int place) const {
    return at(place).state.load(std::memory_order_acquire) == State::kLabelled;
  }
  /// After success the other side leaves the place alone. False: the other side is using it right now.
  [[nodiscard]] bool tryClose(int place);
  /// Labels of a closed place; empty if none arrived.
  [[nodiscard]] ImageView labels(int place) const;
  void free(int place);
  /// Whether a labeller is connected.
  [[nodiscard]] bool hasLabeller() const { return has_labeller_.load(std::memory_order_relaxed); }

  // The other side's thread.

  void setLabeller(bool present) { has_labeller_.store(present, std::memory_order_relaxed); }
  /// Calls `take(stamp, image)` for the oldest image not shown yet. False: there is none.
  template <typename Take>
  bool show(Take&& take) {
    Place* const place = oldestUnseen();
    if (place == nullptr) return false;
    struct LetGo {
      Place& place;
      ~LetGo() { place.state.store(State::kOpen, std::memory_order_release); }
    } let_go{*place};
    ++counters_.shown;
    last_shown_ = place->number;
    take(place->stamp, viewOf(place->image));
    return true;
  }
  /// Offers labels of the image with this stamp. They are copied if a place waits for them.
  void offer(Stamp stamp, const ImageView& labels);
  /// Call periodically: offers early labels again.
  void retryEarly();
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  enum class State : std::uint32_t {
    kFree,
    kOpen,
    kBusy,      ///< in use by the other side for a moment
    kLabelled,  ///< open, with labels
    kClosed,
  };
  struct Place {
    std::atomic<State> state{State::kFree};
    Stamp stamp;  ///< owned by the side that holds the place: the map, or the other side while kBusy
    std::uint64_t number = 0;  ///< from 1, in the order of opening
    bool labelled = false;
    std::vector<std::uint8_t> image, labels;
  };
  struct Early {
    Stamp stamp{kNever};
    std::vector<std::uint8_t> labels;
  };
  static constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::min();

  [[nodiscard]] const Place& at(int place) const { return places_[static_cast<std::size_t>(place)]; }
  [[nodiscard]] Place& at(int place) { return places_[static_cast<std::size_t>(place)]; }
  [[nodiscard]] ImageView viewOf(const std::vector<std::uint8_t>& pixels) const {
    return {pixels.data(), width_, height_, width_};
  }
  [[nodiscard]] Place* oldestUnseen();
  bool hand(Stamp stamp, const ImageView& labels);

  int width_, height_;
  Duration patience_;
  std::array<Place, kPlaces> places_;
  std::atomic<std::int64_t> newest_{kNever};  ///< stamp of the place opened last
  std::atomic<bool> has_labeller_{false};
  std::uint64_t opened_ = 0;  ///< for the map's thread
  // For the other side's thread.
  std::uint64_t last_shown_ = 0;
  std::array<Early, kEarly> early_;
  std::size_t next_early_ = 0;
  Counters counters_;
};

}  // namespace swiftlet
