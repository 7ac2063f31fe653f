#pragma once
// Which earlier keyframes look like this one: an inverted index of words with fixed memory.
//
// add() stores a keyframe's bag of words, query() compares one with all that are stored: for each of its
// words the keyframes that have it are known, so that only common words cost anything. The score is
// similarity() (bag_of_words.hpp); relative to that of the keyframe with its predecessor it tells a revisit
// from a texture that looks the same everywhere (Galvez-Lopez, Tardos, "Bags of Binary Words for Fast Place
// Recognition in Image Sequences", T-RO 2012, sections V.B to V.D). Keyframes near in time that match form an
// island; an island's score is the sum of its members'. It is consistent with the ones before when the
// preceding queries found islands beside it.
//
// Full is a normal state. When keyframes or postings run out, the most redundant keyframe leaves: the one
// whose lesser similarity to its two neighbours in time is greatest (the oldest of equals). Its neighbours
// become each other's. Keyframes too recent to be found by a query yet stay. So places where the drone
// hovered thin out first, and what was seen once stays longest.
//
// Slots: add() gives a number below `keyframes` that stays the keyframe's own until it leaves and is given to
// another; an owner may keep more of each keyframe at the same number.
//
// Memory: about 8 bytes a posting and 4 KiB a keyframe (its bag), 8 bytes a word of the vocabulary, reserved
// by the constructor; nothing grows after. Deterministic. Cost: see docs/place.md.

#include <array>
#include <cstdint>
#include <vector>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/core/status.hpp"
#include "mapping/place/bag_of_words.hpp"

namespace swiftlet {

inline constexpr std::size_t kMaxPlaceCandidates = 32;

struct PlaceDatabaseSettings {
  std::size_t keyframes = 2000;  ///< up to 65 534
  /// Words of keyframes that can be stored together; 0: 400 for each keyframe.
  std::size_t postings = 0;
  double exclude = 10.0;        ///< s: keyframes nearer in time (of the same epoch) are no revisit
  float min_relative = 0.3F;    ///< least score relative to that with the predecessor
  float min_reference = 0.02F;  ///< the predecessor's score counts as at least this,
  float max_reference = 0.3F;   ///< and at most this: who hovers looks more like before than any revisit does
  double island_gap = 3.0;      ///< s: keyframes nearer in time than this belong to one island
  std::size_t per_island = kMaxPlaceCandidates;  ///< candidates of one island at most
  std::size_t candidates = 10;                   ///< at most kMaxPlaceCandidates
  int consistent = 0;  ///< least number of preceding queries with an island beside a candidate's
};

/// A keyframe that may show the same place.
struct PlaceCandidate {
  std::uint32_t slot = 0;
  std::uint64_t index = 0;  ///< the frame's
  Stamp stamp;
  std::uint32_t epoch = 0;
  float score = 0;     ///< similarity, 0 to 1
  float relative = 0;  ///< to the similarity of the query with its predecessor, as bounded by the settings
  float island_score = 0;
  /// Islands of the queries just before, in a row, that lie beside this one's.
  int consistent = 0;
};

struct PlaceQuery {
  /// Best first; those of one island are its best.
  FixedVector<PlaceCandidate, kMaxPlaceCandidates> candidates;
  float reference = 0;       ///< similarity with the predecessor
  std::size_t compared = 0;  ///< stored keyframes old enough
};

struct PlaceDatabaseCounts {
  std::uint64_t added = 0;
  std::uint64_t removed = 0;  ///< by the policy when full
};

class PlaceDatabase {
 public:
  static constexpr std::uint32_t kNoSlot = 0xFFFFFFFFU;

  /// `words`: of the vocabulary whose bags are stored.
  PlaceDatabase(std::size_t words, const PlaceDatabaseSettings& settings = {});

  /// The keyframe's candidates, before it is added itself. Remembers islands for the next query: keyframes
  /// come in the order of time. kNotReady where there is nothing old enough, kInvalidInput for a word beyond
  /// the vocabulary.
  [[nodiscard]] Status query(Stamp stamp, std::uint32_t epoch, const BagOfWords& bag, PlaceQuery& result);
  /// Stores the keyframe. kCapacityReached where another left for it (its slot, or one of those that left,
  /// is taken over); kInvalidInput for a word beyond the vocabulary, or a keyframe that cannot fit.
  [[nodiscard]] Status add(std::uint64_t index, Stamp stamp, std::uint32_t epoch, const BagOfWords& bag,
                           std::uint32_t& slot);

  /// The keyframe of a slot leaves, and the slot is free. False where it holds none.
  bool forget(std::uint32_t slot);

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::size_t capacity() const { return entries_.size(); }
  [[nodiscard]] const PlaceDatabaseCounts& counts() const { return counts_; }
  /// Whether the slot holds this frame.
  [[nodiscard]] bool holds(std::uint32_t slot, std::uint64_t index, std::uint32_t epoch) const;
  /// Bytes reserved.
  [[nodiscard]] std::size_t bytes() const;

 private:
  struct Entry {
    BagOfWords bag;
    std::uint64_t index = 0;
    Stamp stamp;
    std::uint32_t epoch = 0;
    std::uint32_t previous = kNoSlot;  ///< in time
    std::uint32_t next = kNoSlot;
    float with_previous = 0;  ///< similarity
    bool used = false;
  };
  /// Some keyframes of a word. Only a word's first block may be partly filled.
  static constexpr std::size_t kBlock = 10;
  static constexpr std::uint32_t kNoBlock = 0xFFFFFFFFU;
  struct Block {
    std::array<float, kBlock> value{};
    std::array<std::uint16_t, kBlock> slot{};
    std::uint32_t next = kNoBlock;
  };
  struct List {
    std::uint32_t block = kNoBlock;
    std::uint32_t count = 0;  ///< in the first block
  };
  struct Hit {
    std::uint32_t slot;
    float score;
  };
  struct Island {
    std::uint32_t epoch = 0;
    Stamp from, to;
    std::size_t begin = 0, end = 0;  ///< of its hits
    float score = 0;
    int consistent = 0;
  };

  [[nodiscard]] bool fits(const BagOfWords& bag) const;
  [[nodiscard]] bool oldEnough(const Entry& entry, Stamp stamp, std::uint32_t epoch) const;
  void score(const BagOfWords& bag);
  void findIslands(float least, Stamp stamp, std::uint32_t epoch, PlaceQuery& result);
  [[nodiscard]] int consistency(const Island& island) const;
  void give(float reference, PlaceQuery& result);
  [[nodiscard]] std::uint32_t mostRedundant(Stamp stamp, std::uint32_t epoch) const;
  void remove(std::uint32_t slot);
  void insertPosting(WordId word, std::uint32_t slot, float value);
  void removePosting(WordId word, std::uint32_t slot);

  PlaceDatabaseSettings settings_;
  std::vector<Entry> entries_;
  std::vector<std::uint32_t> free_slots_;
  std::vector<List> lists_;
  std::vector<Block> blocks_;
  std::uint32_t free_block_ = kNoBlock;
  std::size_t postings_ = 0;
  std::size_t size_ = 0;
  std::uint32_t oldest_ = kNoSlot;
  std::uint32_t newest_ = kNoSlot;
  std::vector<float> scores_;  ///< of the query in hand, by slot
  std::vector<Hit> hits_;
  std::vector<Island> islands_, before_;  ///< of the query in hand, of the one before
  PlaceDatabaseCounts counts_;
};

}  // namespace swiftlet
