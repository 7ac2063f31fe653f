#include "drivers/dds/topic_search.hpp"

#include <algorithm>
#include <utility>

#include "drivers/input/edit_distance.hpp"

namespace swiftlet {

std::string missingTopic(std::span<const PublishedTopic> published, std::string_view type,
                         std::string_view name) {
  constexpr std::size_t kMost = 3;
  std::vector<std::pair<std::size_t, std::string_view>> near;
  for (const PublishedTopic& topic : published) {
    if (topic.name == name) {
      return std::string(name) + " is a " + topic.type + ", expected a " + std::string(type);
    }
    if (topic.type == type) near.emplace_back(editDistance(topic.name, name), topic.name);
  }
  std::ranges::sort(near);
  std::string text = "no publisher of " + std::string(type) + " on " + std::string(name);
  if (near.empty()) return text + ", nor on any other topic";
  text += "; near: ";
  for (std::size_t i = 0; i < std::min(kMost, near.size()); ++i) {
    text += (i > 0 ? ", " : "") + std::string(near[i].second);
  }
  return text;
}

}  // namespace swiftlet
