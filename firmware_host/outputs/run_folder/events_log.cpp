#include "firmware_host/outputs/run_folder/events_log.hpp"

#include <fstream>
#include <utility>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/csv_reader.hpp"
#include "drivers/recorded/parse_number.hpp"

namespace swiftlet {

std::vector<EventLine> readEvents(const std::string& path, std::size_t* skipped) {
  constexpr const char* kRemedy = "Each line is `seconds event text`. Replay again, or delete the line";
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(path, 0, "", "cannot be read", "Give the folder of a run");
  std::vector<EventLine> events;
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    if (line.empty()) continue;
    const std::size_t first = line.find(' ');
    const std::string stamp = line.substr(0, first);
    const std::size_t second = first == std::string::npos ? first : line.find(' ', first + 1);
    EventLine event;
    if (first != std::string::npos) event.name = line.substr(first + 1, second - first - 1);
    if (second != std::string::npos) event.text = line.substr(second + 1);
    const bool has_stamp = parseSeconds(stamp, event.stamp);
    if (has_stamp && !event.name.empty()) {
      events.push_back(std::move(event));
    } else if (skipped != nullptr) {
      ++*skipped;
    } else if (!has_stamp) {
      throw InputError(path, number, "stamp", quoteInput(stamp) + " is not a time in seconds", kRemedy);
    } else {
      throw InputError(path, number, "event", "is missing after the stamp", kRemedy);
    }
  }
  return events;
}

}  // namespace swiftlet
