#include "firmware_host/interfaces/label_exchange.hpp"

#include <utility>

#include "firmware_host/interfaces/packed_copy.hpp"

namespace swiftlet {

LabelExchange::LabelExchange(int width, int height, Duration patience)
    : width_(width), height_(height), patience_(patience) {
  const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  for (Place& place : places_) {
    place.image.resize(pixels);
    place.labels.resize(pixels);
  }
  for (Early& early : early_) early.labels.resize(pixels);
}

std::int64_t LabelExchange::bytes() const { return std::int64_t{2 * kPlaces + kEarly} * width_ * height_; }

int LabelExchange::open(Stamp stamp, const ImageView& image) {
  for (std::size_t i = 0; i < kPlaces; ++i) {
    Place& place = places_[i];
    // Acquire: the other side's accesses to this place have finished.
    if (place.state.load(std::memory_order_acquire) != State::kFree) continue;
    place.stamp = stamp;
    place.number = ++opened_;
    place.labelled = false;
    packedCopy(image, place.image.data());
    place.state.store(State::kOpen, std::memory_order_release);
    newest_.store(stamp.ns, std::memory_order_release);
    return static_cast<int>(i);
  }
  return -1;
}

bool LabelExchange::tryClose(int place) {
  Place& closed = at(place);
  State state = State::kLabelled;
  if (closed.state.compare_exchange_strong(state, State::kClosed, std::memory_order_acq_rel)) return true;
  state = State::kOpen;
  return closed.state.compare_exchange_strong(state, State::kClosed, std::memory_order_acq_rel);
}

ImageView LabelExchange::labels(int place) const {
  return at(place).labelled ? viewOf(at(place).labels) : ImageView{};
}

void LabelExchange::free(int place) { at(place).state.store(State::kFree, std::memory_order_release); }

/// Leaves the returned place in state kBusy.
LabelExchange::Place* LabelExchange::oldestUnseen() {
  Place* oldest = nullptr;
  for (Place& place : places_) {
    State state = State::kOpen;
    if (!place.state.compare_exchange_strong(state, State::kBusy, std::memory_order_acq_rel)) continue;
    Place* let_go = &place;
    if (place.number > last_shown_ && (oldest == nullptr || place.number < oldest->number)) {
      std::swap(let_go, oldest);
    }
    if (let_go != nullptr) let_go->state.store(State::kOpen, std::memory_order_release);
  }
  return oldest;
}

/// False: no place waits for labels of this stamp.
bool LabelExchange::hand(Stamp stamp, const ImageView& labels) {
  for (Place& place : places_) {
    State state = State::kOpen;
    if (!place.state.compare_exchange_strong(state, State::kBusy, std::memory_order_acq_rel)) continue;
    if (place.stamp != stamp) {
      place.state.store(State::kOpen, std::memory_order_release);
      continue;
    }
    packedCopy(labels, place.labels.data());
    place.labelled = true;
    place.state.store(State::kLabelled, std::memory_order_release);
    ++counters_.taken;
    return true;
  }
  return false;
}

void LabelExchange::offer(Stamp stamp, const ImageView& labels) {
  ++counters_.offered;
  if (labels.empty() || labels.width != width_ || labels.height != height_) {
    ++counters_.wrong_size;
    return;
  }
  // Read before the places: a stamp opened meanwhile counts as early and is offered again.
  const std::int64_t newest = newest_.load(std::memory_order_acquire);
  if (hand(stamp, labels)) return;
  if (stamp.ns <= newest) {
    ++counters_.unawaited;
    return;
  }
  Early& oldest = early_[next_early_++ % kEarly];
  if (oldest.stamp.ns != kNever) ++counters_.unawaited;
  oldest.stamp = stamp;
  packedCopy(labels, oldest.labels.data());
}

void LabelExchange::retryEarly() {
  const std::int64_t newest = newest_.load(std::memory_order_acquire);
  for (Early& early : early_) {
    if (early.stamp.ns == kNever || early.stamp.ns > newest) continue;
    if (!hand(early.stamp, viewOf(early.labels))) ++counters_.unawaited;
    early.stamp.ns = kNever;
  }
}

}  // namespace swiftlet
