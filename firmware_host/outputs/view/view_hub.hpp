#pragma once
// A bounded queue for each viewer, between the thread that makes the live view's patches and those that send
// them.
//
// A viewer first gets a document, then every later patch, in order. A viewer that does not keep up loses its
// queue and gets a new document after it has taken what is being sent. Only the newest images wait, after the
// patches: a slow viewer sees fewer. Nobody waits for a viewer.
//
// Threads: one publishes, each viewer has its own. One lock, held for a few pointer moves; no flight thread
// uses it. Memory: texts are shared by all viewers; at most the newest kMostWaiting patches, one document,
// the newest images and what each viewer is being sent are alive.

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
  static constexpr std::size_t kMostWaiting = 25;  ///< patches, for 5 s

  struct Counters {
    std::uint64_t viewers = 0;           ///< viewers admitted
    std::uint64_t refused = 0;           ///< viewers refused for lack of room
    std::uint64_t patches = 0;           ///< made
    std::uint64_t documents = 0;         ///< made
    std::uint64_t delivered = 0;         ///< patches sent, summed over viewers
    std::uint64_t dropped = 0;           ///< patches lost because a viewer was slow, summed over viewers
    std::uint64_t given_up = 0;          ///< viewers that took nothing for too long
    std::uint64_t most_viewers = 0;      ///< largest number at one time
    std::uint64_t images = 0;            ///< instants of images made
    std::uint64_t images_delivered = 0;  ///< sent, summed over viewers
    std::uint64_t images_dropped = 0;    ///< lost because a viewer was slow, summed over viewers
    std::uint64_t bytes = 0;             ///< sent to all viewers together
  };

  enum class Next { kMessage, kNothing, kEnded };

  // For the publishing thread.
  /// Sends a patch to all viewers that have a document.
  void publish(const Text& patch);
  /// Sends images of an instant to all viewers that have a document; replaces those still waiting.
  void publishImages(const Text& images);
  /// Share of the images since the last call that the fastest viewer has taken; 1 if there were none.
  [[nodiscard]] double imagesTaken();
  /// Whether a viewer waits for a document, which must be the state after the last patch.
  [[nodiscard]] bool documentWanted() const;
  /// Sends a document to the viewers that wait for one.
  void offer(const Text& document);
  [[nodiscard]] std::size_t viewers() const;
  /// Ends the patches: viewers get what is queued for them, then Next::kEnded.
  void end();

  // For the viewers' threads.
  /// Returns a place; -1: all are taken, or the hub has ended.
  [[nodiscard]] int admit();
  /// Waits up to `seconds` for the next text of this place.
  Next next(int place, double seconds, Text& out);
  /// Frees the place. `given_up`: the viewer took nothing for too long.
  void leave(int place, bool given_up);

  [[nodiscard]] Counters counters() const;

 private:
  enum class Wish { kDocument, kPatches, kLost };  ///< kLost: too slow, and still sending
  struct Place {
    bool taken = false;
    Wish wish = Wish::kDocument;
    std::deque<Text> waiting;
    std::size_t documents_waiting = 0;                   ///< at the head of `waiting`: 0 or 1
    Text images;                                         ///< null: none waiting
    std::uint64_t images_offered = 0, images_taken = 0;  ///< since the last imagesTaken()
  };

  mutable std::mutex mutex_;
  std::condition_variable news_;
  std::array<Place, kMostViewers> places_;
  Counters counters_;
  bool ended_ = false;
};

nlohmann::ordered_json toJson(const ViewHub::Counters& counters);

}  // namespace swiftlet
