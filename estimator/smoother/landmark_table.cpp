#include "estimator/smoother/landmark_table.hpp"

#include <algorithm>

namespace swiftlet {

void LandmarkTable::clear() {
  used_.fill(0);
  by_id_.clear();
}

std::size_t LandmarkTable::usedFrom(std::size_t index) const {
  for (std::size_t word = index / kBits; word < used_.size(); ++word) {
    std::uint64_t bits = used_[word];
    if (word == index / kBits) bits &= ~std::uint64_t{0} << (index % kBits);
    if (bits != 0) return word * kBits + static_cast<std::size_t>(std::countr_zero(bits));
  }
  return kMaxLandmarks;
}

std::size_t LandmarkTable::lowestFree() const {
  for (std::size_t word = 0; word < used_.size(); ++word) {
    if (~used_[word] != 0) return word * kBits + static_cast<std::size_t>(std::countr_one(used_[word]));
  }
  return kMaxLandmarks;
}

LandmarkTable::Entry* LandmarkTable::entryFrom(TrackId id) {
  return std::lower_bound(by_id_.begin(), by_id_.end(), id,
                          [](const Entry& entry, TrackId wanted) { return entry.id < wanted; });
}

Landmark* LandmarkTable::find(TrackId id) {
  const Entry* const entry = entryFrom(id);
  return entry != by_id_.end() && entry->id == id ? &landmarks_[entry->index] : nullptr;
}

void LandmarkTable::makeRoom() {
  static_assert(kMaxExplicitLandmarks < kMaxLandmarks);
  Landmark* oldest = nullptr;
  for (Landmark& landmark : *this) {
    if (landmark.extra != kNoExtra) continue;
    if (oldest == nullptr || landmark.last_frame < oldest->last_frame) oldest = &landmark;
  }
  remove(*oldest);
}

Landmark& LandmarkTable::add(TrackId id) {
  if (by_id_.full()) makeRoom();
  const std::size_t index = lowestFree();
  used_[index / kBits] |= std::uint64_t{1} << (index % kBits);
  by_id_.insert(static_cast<std::size_t>(entryFrom(id) - by_id_.begin()),
                {id, static_cast<std::uint32_t>(index)});
  Landmark& landmark = landmarks_[index];
  landmark.id = id;
  landmark.frames_seen = 0;
  landmark.rejections = 0;
  landmark.in_system = false;
  landmark.extra = kNoExtra;
  landmark.point.triangulated = false;
  landmark.sightings.clear();
  return landmark;
}

void LandmarkTable::remove(Landmark& landmark) {
  const std::size_t index = indexOf(landmark);
  used_[index / kBits] &= ~(std::uint64_t{1} << (index % kBits));
  by_id_.erase(static_cast<std::size_t>(entryFrom(landmark.id) - by_id_.begin()));
}

void LandmarkTable::removeSightingsOf(std::uint32_t slot) {
  for (Landmark& landmark : *this) {
    for (std::size_t s = 0; s < landmark.sightings.size(); ++s) {
      if (landmark.sightings[s].slot != slot) continue;
      landmark.sightings.erase(s);
      break;
    }
    if (landmark.sightings.empty() && landmark.extra == kNoExtra) remove(landmark);
  }
}

}  // namespace swiftlet
