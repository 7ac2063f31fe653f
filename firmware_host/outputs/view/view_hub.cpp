#include "firmware_host/outputs/view/view_hub.hpp"

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>
#include <utility>

namespace swiftlet {

void ViewHub::publish(const Text& patch) {
  {
    const std::lock_guard lock(mutex_);
    ++counters_.patches;
    for (Place& place : places_) {
      if (!place.taken || place.wish == Wish::kDocument) continue;
      if (place.wish == Wish::kPatches && place.waiting.size() < kMostWaiting) {
        place.waiting.push_back(patch);
        continue;
      }
      // A waiting document is dropped with the patches, since it is older than they are.
      counters_.dropped += 1 + place.waiting.size() - place.documents_waiting;
      place.waiting.clear();
      place.documents_waiting = 0;
      if (std::exchange(place.images, nullptr)) ++counters_.images_dropped;
      place.wish = Wish::kLost;
    }
  }
  news_.notify_all();
}

void ViewHub::publishImages(const Text& images) {
  {
    const std::lock_guard lock(mutex_);
    ++counters_.images;
    for (Place& place : places_) {
      if (!place.taken || place.wish != Wish::kPatches) continue;
      if (place.images) ++counters_.images_dropped;
      place.images = images;
      ++place.images_offered;
    }
  }
  news_.notify_all();
}

double ViewHub::imagesTaken() {
  const std::lock_guard lock(mutex_);
  double most = 0;
  bool any = false;
  for (Place& place : places_) {
    if (!place.taken || place.images_offered == 0) continue;
    any = true;
    most =
        std::max(most, static_cast<double>(place.images_taken) / static_cast<double>(place.images_offered));
    place.images_offered = place.images_taken = 0;
  }
  return any ? most : 1;
}

bool ViewHub::documentWanted() const {
  const std::lock_guard lock(mutex_);
  return std::ranges::any_of(places_,
                             [](const Place& place) { return place.taken && place.wish == Wish::kDocument; });
}

void ViewHub::offer(const Text& document) {
  {
    const std::lock_guard lock(mutex_);
    ++counters_.documents;
    for (Place& place : places_) {
      if (!place.taken || place.wish != Wish::kDocument) continue;
      place.waiting.assign(1, document);
      place.documents_waiting = 1;
      place.wish = Wish::kPatches;
    }
  }
  news_.notify_all();
}

std::size_t ViewHub::viewers() const {
  const std::lock_guard lock(mutex_);
  return static_cast<std::size_t>(
      std::ranges::count_if(places_, [](const Place& place) { return place.taken; }));
}

void ViewHub::end() {
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  news_.notify_all();
}

int ViewHub::admit() {
  const std::lock_guard lock(mutex_);
  const auto free = std::ranges::find_if(places_, [](const Place& place) { return !place.taken; });
  if (ended_ || free == places_.end()) {
    ++counters_.refused;
    return -1;
  }
  *free = Place{};
  free->taken = true;
  ++counters_.viewers;
  const auto taken = std::ranges::count_if(places_, [](const Place& place) { return place.taken; });
  counters_.most_viewers = std::max(counters_.most_viewers, static_cast<std::uint64_t>(taken));
  return static_cast<int>(free - places_.begin());
}

ViewHub::Next ViewHub::next(int place, double seconds, Text& out) {
  std::unique_lock lock(mutex_);
  Place& mine = places_[static_cast<std::size_t>(place)];
  if (mine.wish == Wish::kLost) mine.wish = Wish::kDocument;
  news_.wait_for(lock, std::chrono::duration<double>(seconds),
                 [&] { return ended_ || !mine.waiting.empty() || mine.images; });
  if (mine.waiting.empty() && mine.images) {
    out = std::exchange(mine.images, nullptr);
    ++mine.images_taken;
    ++counters_.images_delivered;
    counters_.bytes += out->size();
    return Next::kMessage;
  }
  if (mine.waiting.empty()) return ended_ ? Next::kEnded : Next::kNothing;
  out = std::move(mine.waiting.front());
  mine.waiting.pop_front();
  counters_.bytes += out->size();
  if (mine.documents_waiting > 0) {
    mine.documents_waiting = 0;
  } else {
    ++counters_.delivered;
  }
  return Next::kMessage;
}

void ViewHub::leave(int place, bool given_up) {
  const std::lock_guard lock(mutex_);
  places_[static_cast<std::size_t>(place)] = Place{};
  if (given_up) ++counters_.given_up;
}

ViewHub::Counters ViewHub::counters() const {
  const std::lock_guard lock(mutex_);
  return counters_;
}

nlohmann::ordered_json toJson(const ViewHub::Counters& counters) {
  return {{"viewers", counters.viewers},
          {"most_viewers", counters.most_viewers},
          {"refused", counters.refused},
          {"patches", counters.patches},
          {"documents", counters.documents},
          {"delivered", counters.delivered},
          {"dropped", counters.dropped},
          {"given_up", counters.given_up},
          {"images", counters.images},
          {"images_delivered", counters.images_delivered},
          {"images_dropped", counters.images_dropped},
          {"bytes", counters.bytes}};
}

}  // namespace swiftlet
