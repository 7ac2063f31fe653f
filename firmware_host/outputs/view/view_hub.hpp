#pragma once
// Between who makes the live view's patches and who sends them: a bounded queue for each viewer.
//
// A viewer first gets a document, then every patch after it, in order. One that does not keep up loses what
// waits for it and gets a fresh document once it has taken what it was being sent. Of images the newest waits
// alone, behind the patches: a slow viewer sees fewer. Nobody waits for a viewer.
//
// Threads: one publishes, each viewer has its own. One lock, held for a few moves of pointers; no flight
// thread comes here. Memory: texts are shared by all viewers; alive are at most the newest kMostWaiting
// patches, one document, the newest images and what each viewer is being sent.

#include <array>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace swiftlet {

class ViewHub {
 public:
  using Text = std::shared_ptr<const std::string>;

  static constexpr std::size_t kMostViewers = 8;
  static constexpr std::size_t kMostWaiting = 25;  ///< patches: 5 s of them

  struct Counters {
    std::uint64_t viewers = 0;       ///< that were let in
    std::uint64_t refused = 0;       ///< for want of room
    std::uint64_t patches = 0;       ///< made
    std::uint64_t documents = 0;     ///< made
    std::uint64_t delivered = 0;     ///< patches that went to a viewer; each viewer's count
    std::uint64_t dropped = 0;       ///< patches that a viewer lost because it was slow; each viewer's count
    std::uint64_t given_up = 0;      ///< viewers that took nothing for too long
    std::uint64_t most_viewers = 0;  ///< at one time
    std::uint64_t images = 0;        ///< instants of images made
    std::uint64_t images_delivered = 0;  ///< that went to a viewer; each viewer's count
    std::uint64_t images_dropped = 0;    ///< that a viewer lost because it was slow; each viewer's count
    std::uint64_t bytes = 0;             ///< that went to viewers, all together
  };

  enum class Next { kMessage, kNothing, kEnded };

  // Publishing thread.
  /// For all who have a document.
  void publish(const Text& patch);
  /// Images of an instant, for all who have a document; they replace those that still wait.
  void publishImages(const Text& images);
  /// Share of the images since the last call that the quickest viewer has taken; 1 where there were none.
  [[nodiscard]] double imagesTaken();
  /// Whether somebody waits for a document. It has to stand for the state after the last patch.
  [[nodiscard]] bool documentWanted() const;
  /// For those who wait for it.
  void offer(const Text& document);
  [[nodiscard]] std::size_t viewers() const;
  /// No further patches: viewers get what waits for them, then Next::kEnded.
  void end();

  // Viewers' threads.
  /// A place, or -1: all are taken, or it has ended.
  [[nodiscard]] int admit();
  /// The next text for this place, waiting for it up to `seconds`.
  Next next(int place, double seconds, Text& out);
  /// The place is free again. `given_up`: it took nothing for too long.
  void leave(int place, bool given_up);

  [[nodiscard]] Counters counters() const;

 private:
  enum class Wish { kDocument, kPatches, kLost };  ///< kLost: slow, and still sending
  struct Place {
    bool taken = false;
    Wish wish = Wish::kDocument;
    std::deque<Text> waiting;
    std::size_t documents_waiting = 0;                   ///< at the head of `waiting`: 0 or 1
    Text images;                                         ///< null: none waits
    std::uint64_t images_offered = 0, images_taken = 0;  ///< since imagesTaken()
  };

  mutable std::mutex mutex_;
  std::condition_variable news_;
  std::array<Place, kMostViewers> places_;
  Counters counters_;
  bool ended_ = false;
};

nlohmann::ordered_json toJson(const ViewHub::Counters& counters);

}  // namespace swiftlet
