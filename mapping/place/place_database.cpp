#include "mapping/place/place_database.hpp"

#include <algorithm>

namespace swiftlet {
namespace {

constexpr std::size_t kMaxKeyframes = 65534;  // slots are kept in 16 bits
constexpr std::size_t kPostingsPerKeyframe = 400;

bool near(Stamp a, Stamp b, double seconds) {
  const double gap = (a - b).seconds();
  return gap <= seconds && gap >= -seconds;
}

}  // namespace

PlaceDatabase::PlaceDatabase(std::size_t words, const PlaceDatabaseSettings& settings) : settings_(settings) {
  settings_.keyframes = std::clamp<std::size_t>(settings_.keyframes, 1, kMaxKeyframes);
  if (settings_.postings == 0) settings_.postings = kPostingsPerKeyframe * settings_.keyframes;
  settings_.max_reference = std::max(settings_.max_reference, settings_.min_reference);
  settings_.candidates = std::min(settings_.candidates, kMaxPlaceCandidates);
  entries_.resize(settings_.keyframes);
  free_slots_.reserve(settings_.keyframes);
  for (std::size_t i = settings_.keyframes; i > 0; --i)
    free_slots_.push_back(static_cast<std::uint32_t>(i - 1));
  lists_.resize(words);
  // Every word may have one partly filled block.
  blocks_.resize(settings_.postings / kBlock + std::min(words, settings_.postings) + 1);
  for (std::size_t i = blocks_.size(); i > 0; --i) {
    blocks_[i - 1].next = free_block_;
    free_block_ = static_cast<std::uint32_t>(i - 1);
  }
  scores_.resize(settings_.keyframes, 0);
  hits_.reserve(settings_.keyframes);
  islands_.reserve(settings_.keyframes);
  before_.reserve(settings_.keyframes);
}

std::size_t PlaceDatabase::bytes() const {
  return entries_.capacity() * sizeof(Entry) + free_slots_.capacity() * sizeof(std::uint32_t) +
         lists_.capacity() * sizeof(List) + blocks_.capacity() * sizeof(Block) +
         scores_.capacity() * sizeof(float) + hits_.capacity() * sizeof(Hit) +
         (islands_.capacity() + before_.capacity()) * sizeof(Island);
}

bool PlaceDatabase::holds(std::uint32_t slot, std::uint64_t index, std::uint32_t epoch) const {
  if (slot >= entries_.size()) return false;
  const Entry& entry = entries_[slot];
  return entry.used && entry.index == index && entry.epoch == epoch;
}

// Whether the words rise strictly, are in the vocabulary and have positive values.
bool PlaceDatabase::fits(const BagOfWords& bag) const {
  for (std::size_t i = 0; i < bag.size(); ++i) {
    if (bag[i].word >= lists_.size() || (i > 0 && bag[i].word <= bag[i - 1].word) || !(bag[i].value > 0))
      return false;
  }
  return true;
}

bool PlaceDatabase::oldEnough(const Entry& entry, Stamp stamp, std::uint32_t epoch) const {
  return entry.epoch != epoch || (stamp - entry.stamp).seconds() >= settings_.exclude;
}

void PlaceDatabase::insertPosting(WordId word, std::uint32_t slot, float value) {
  List& list = lists_[word];
  if (list.block == kNoBlock || list.count == kBlock) {
    const std::uint32_t block = free_block_;
    free_block_ = blocks_[block].next;
    blocks_[block].next = list.block;
    list = {block, 0};
  }
  Block& block = blocks_[list.block];
  block.slot[list.count] = static_cast<std::uint16_t>(slot);
  block.value[list.count] = value;
  ++list.count;
  ++postings_;
}

// The list's newest posting takes the removed one's place.
void PlaceDatabase::removePosting(WordId word, std::uint32_t slot) {
  List& list = lists_[word];
  std::size_t count = list.count;
  for (std::uint32_t b = list.block; b != kNoBlock; b = blocks_[b].next, count = kBlock) {
    for (std::size_t i = 0; i < count; ++i) {
      if (blocks_[b].slot[i] != slot) continue;
      Block& first = blocks_[list.block];
      blocks_[b].slot[i] = first.slot[list.count - 1];
      blocks_[b].value[i] = first.value[list.count - 1];
      --postings_;
      if (--list.count > 0) return;
      const std::uint32_t emptied = list.block;
      list = {first.next, static_cast<std::uint32_t>(first.next == kNoBlock ? 0 : kBlock)};
      blocks_[emptied].next = free_block_;
      free_block_ = emptied;
      return;
    }
  }
}

void PlaceDatabase::score(const BagOfWords& bag) {
  std::fill(scores_.begin(), scores_.end(), 0.0F);
  for (const WordValue& entry : bag) {
    std::size_t count = lists_[entry.word].count;
    for (std::uint32_t b = lists_[entry.word].block; b != kNoBlock; b = blocks_[b].next, count = kBlock) {
      const Block& block = blocks_[b];
      for (std::size_t i = 0; i < count; ++i) scores_[block.slot[i]] += std::min(entry.value, block.value[i]);
    }
  }
}

// Number of consecutive preceding queries with an island near this one in time.
int PlaceDatabase::consistency(const Island& island) const {
  int longest = 0;
  for (const Island& other : before_) {
    if (other.epoch != island.epoch) continue;
    const bool apart = (island.from - other.to).seconds() > settings_.island_gap ||
                       (other.from - island.to).seconds() > settings_.island_gap;
    if (!apart) longest = std::max(longest, other.consistent + 1);
  }
  return longest;
}

void PlaceDatabase::findIslands(float least, Stamp stamp, std::uint32_t epoch, PlaceQuery& result) {
  hits_.clear();
  islands_.clear();
  for (std::uint32_t slot = oldest_; slot != kNoSlot; slot = entries_[slot].next) {
    const Entry& entry = entries_[slot];
    if (!oldEnough(entry, stamp, epoch)) continue;
    ++result.compared;
    if (scores_[slot] < least) continue;
    const bool joins = !islands_.empty() && islands_.back().epoch == entry.epoch &&
                       near(entry.stamp, islands_.back().to, settings_.island_gap);
    if (!joins) {
      Island island;
      island.epoch = entry.epoch;
      island.from = entry.stamp;
      island.begin = hits_.size();
      islands_.push_back(island);
    }
    Island& island = islands_.back();
    hits_.push_back({slot, scores_[slot]});
    island.to = entry.stamp;
    island.end = hits_.size();
    island.score += scores_[slot];
  }
  for (Island& island : islands_) island.consistent = consistency(island);
}

void PlaceDatabase::give(float reference, PlaceQuery& result) {
  const auto better = [](const PlaceCandidate& a, const PlaceCandidate& b) {
    return a.score != b.score ? a.score > b.score : a.slot < b.slot;
  };
  for (const Island& island : islands_) {
    if (island.consistent < settings_.consistent) continue;
    const auto begin = hits_.begin() + static_cast<std::ptrdiff_t>(island.begin);
    const auto end = hits_.begin() + static_cast<std::ptrdiff_t>(island.end);
    std::sort(begin, end, [](const Hit& a, const Hit& b) {
      return a.score != b.score ? a.score > b.score : a.slot < b.slot;
    });
    const std::size_t most = std::min(settings_.per_island, island.end - island.begin);
    for (std::size_t i = 0; i < most; ++i) {
      const Hit& hit = hits_[island.begin + i];
      const Entry& entry = entries_[hit.slot];
      const PlaceCandidate candidate = {hit.slot,  entry.index,           entry.stamp,  entry.epoch,
                                        hit.score, hit.score / reference, island.score, island.consistent};
      auto& kept = result.candidates;
      if (kept.size() == settings_.candidates) {
        if (kept.empty() || !better(candidate, kept.back())) continue;
        kept.popBack();
      }
      (void)kept.tryPushBack(candidate);
      for (std::size_t k = kept.size() - 1; k > 0 && better(kept[k], kept[k - 1]); --k)
        std::swap(kept[k], kept[k - 1]);
    }
  }
}

Status PlaceDatabase::query(Stamp stamp, std::uint32_t epoch, const BagOfWords& bag, PlaceQuery& result) {
  result.candidates.clear();
  result.compared = 0;
  result.reference = 0;
  if (!fits(bag))
    return {StatusCode::kInvalidInput, "a bag of words does not fit the place database's vocabulary"};
  islands_.swap(before_);
  islands_.clear();
  if (newest_ == kNoSlot) return {StatusCode::kNotReady, "no keyframe to compare with"};
  result.reference = similarity(bag, entries_[newest_].bag);
  const float reference = std::clamp(result.reference, settings_.min_reference, settings_.max_reference);
  score(bag);
  findIslands(settings_.min_relative * reference, stamp, epoch, result);
  if (result.compared == 0) return {StatusCode::kNotReady, "no keyframe old enough to compare with"};
  give(reference, result);
  return okStatus();
}

// The oldest and the newest keyframe have only one neighbour in time.
std::uint32_t PlaceDatabase::mostRedundant(Stamp stamp, std::uint32_t epoch) const {
  std::uint32_t best = kNoSlot;
  float most = -1;
  for (std::uint32_t slot = oldest_; slot != kNoSlot; slot = entries_[slot].next) {
    const Entry& entry = entries_[slot];
    if (!oldEnough(entry, stamp, epoch)) continue;
    float redundancy = 1;
    if (entry.previous != kNoSlot) redundancy = std::min(redundancy, entry.with_previous);
    if (entry.next != kNoSlot) redundancy = std::min(redundancy, entries_[entry.next].with_previous);
    if (redundancy <= most) continue;
    most = redundancy;
    best = slot;
  }
  return best != kNoSlot ? best : oldest_;
}

bool PlaceDatabase::forget(std::uint32_t slot) {
  if (slot >= entries_.size() || !entries_[slot].used) return false;
  remove(slot);
  --counts_.removed;  // counts only removals from a full database
  return true;
}

void PlaceDatabase::remove(std::uint32_t slot) {
  Entry& entry = entries_[slot];
  for (const WordValue& w : entry.bag) removePosting(w.word, slot);
  if (entry.previous != kNoSlot) entries_[entry.previous].next = entry.next;
  if (entry.next != kNoSlot) {
    Entry& next = entries_[entry.next];
    next.previous = entry.previous;
    next.with_previous =
        entry.previous != kNoSlot ? similarity(next.bag, entries_[entry.previous].bag) : 0.0F;
  }
  if (oldest_ == slot) oldest_ = entry.next;
  if (newest_ == slot) newest_ = entry.previous;
  entry.used = false;
  free_slots_.push_back(slot);
  --size_;
  ++counts_.removed;
}

Status PlaceDatabase::add(std::uint64_t index, Stamp stamp, std::uint32_t epoch, const BagOfWords& bag,
                          std::uint32_t& slot) {
  slot = kNoSlot;
  if (!fits(bag))
    return {StatusCode::kInvalidInput, "a bag of words does not fit the place database's vocabulary"};
  if (bag.size() > settings_.postings)
    return {StatusCode::kInvalidInput, "a bag of words beyond the place database's size"};
  const std::uint64_t removed = counts_.removed;
  while (free_slots_.empty() || postings_ + bag.size() > settings_.postings)
    remove(mostRedundant(stamp, epoch));
  slot = free_slots_.back();
  free_slots_.pop_back();
  Entry& entry = entries_[slot];
  entry.bag = bag;
  entry.index = index;
  entry.stamp = stamp;
  entry.epoch = epoch;
  entry.previous = newest_;
  entry.next = kNoSlot;
  entry.with_previous = newest_ != kNoSlot ? similarity(bag, entries_[newest_].bag) : 0.0F;
  entry.used = true;
  if (newest_ != kNoSlot) entries_[newest_].next = slot;
  if (oldest_ == kNoSlot) oldest_ = slot;
  newest_ = slot;
  for (const WordValue& w : bag) insertPosting(w.word, slot, w.value);
  ++size_;
  ++counts_.added;
  if (counts_.removed == removed) return okStatus();
  return {StatusCode::kCapacityReached,
          "the place database is full: its most redundant keyframe was removed"};
}

}  // namespace swiftlet
