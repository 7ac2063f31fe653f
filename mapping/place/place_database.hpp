#pragma once
// Finds earlier keyframes that look like a new one: an inverted index of words with fixed memory.
//
// add() stores a keyframe's bag of words, query() compares one with all stored keyframes. The index lists the
// keyframes of each word, so only common words cost time. The score is similarity() (bag_of_words.hpp).
// Divided by the score of the keyframe with its predecessor, it distinguishes a revisit from a texture that
// looks the same everywhere (Galvez-Lopez, Tardos, "Bags of Binary Words for Fast Place Recognition in Image
// Sequences", T-RO 2012, sections V.B to V.D). Matching keyframes near in time form an island; its score is
// the sum of its members'. An island is consistent if the preceding queries found islands beside it.
//
// Full is a normal state. When keyframes or postings run out, the most redundant keyframe is removed: the one
// whose smaller similarity to its two neighbours in time is greatest (the oldest of equals). Keyframes too
// recent to be found by a query stay. Places where the drone hovered are thus thinned first, and places seen
// once stay longest.
//
// Slots: add() returns an index below `keyframes`, which belongs to the keyframe until it is removed. The
// caller may keep further data of each keyframe by this index.
//
// Memory: about 8 bytes a posting and 4 KiB a keyframe (its bag), 8 bytes a word of the vocabulary, reserved
// by the constructor; nothing grows afterwards. Deterministic. Cost: docs/place.md.

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
  /// Total number of words of all keyframes; 0: 400 for each keyframe.
  std::size_t postings = 0;
  double exclude = 10.0;        ///< s: keyframes of the same epoch nearer in time are no revisit
  float min_relative = 0.3F;    ///< least score relative to that with the predecessor
  float min_reference = 0.02F;  ///< lower limit of the predecessor's score
  float max_reference = 0.3F;   ///< upper limit: hovering resembles the last image more than any revisit
  double island_gap = 3.0;      ///< s: keyframes nearer in time than this belong to one island
  std::size_t per_island = kMaxPlaceCandidates;  ///< largest number of candidates of one island
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
  /// Number of consecutive preceding queries with an island beside this candidate's.
  int consistent = 0;
};

struct PlaceQuery {
  /// Best first; of each island its best.
  FixedVector<PlaceCandidate, kMaxPlaceCandidates> candidates;
  float reference = 0;       ///< similarity with the predecessor
  std::size_t compared = 0;  ///< number of stored keyframes that are old enough
};

struct PlaceDatabaseCounts {
  std::uint64_t added = 0;
  std::uint64_t removed = 0;  ///< because the database was full
};

class PlaceDatabase {
 public:
  static constexpr std::uint32_t kNoSlot = 0xFFFFFFFFU;

  /// `words`: number of words of the vocabulary.
  PlaceDatabase(std::size_t words, const PlaceDatabaseSettings& settings = {});

  /// Candidates of a keyframe; call it before add(). Keyframes must come in order of time, because islands
  /// are remembered for the next query. kNotReady if no stored keyframe is old enough, kInvalidInput for an
  /// invalid bag: words beyond the vocabulary or not rising, values not above 0.
  [[nodiscard]] Status query(Stamp stamp, std::uint32_t epoch, const BagOfWords& bag, PlaceQuery& result);
  /// Stores the keyframe. kCapacityReached if others were removed for it; it then reuses a slot of theirs.
  /// kInvalidInput for an invalid bag, or a keyframe that cannot fit.
  [[nodiscard]] Status add(std::uint64_t index, Stamp stamp, std::uint32_t epoch, const BagOfWords& bag,
                           std::uint32_t& slot);

  /// Removes the keyframe of a slot. False if the slot is free.
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
  std::vector<float> scores_;  ///< of the present query, by slot
  std::vector<Hit> hits_;
  std::vector<Island> islands_, before_;  ///< of the present query and of the one before
  PlaceDatabaseCounts counts_;
};

}  // namespace swiftlet
