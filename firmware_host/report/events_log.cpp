#include "firmware_host/report/events_log.hpp"

#include <fstream>

#include "drivers/calibration/input_error.hpp"
#include "drivers/recorded/parse_number.hpp"

namespace swiftlet {

std::vector<EventLine> readEvents(const std::string& path, std::size_t* skipped) {
  std::ifstream file(path);
  if (!file) {
    throw InputError(path, 0, "", "cannot be read", "Give the folder of a run");
  }
  std::vector<EventLine> events;
  std::string line;
  while (std::getline(file, line)) {
    const std::size_t space = line.find(' ');
    EventLine event;
    if (space == std::string::npos || !parseSeconds(line.substr(0, space), event.stamp)) {
      if (skipped != nullptr && !line.empty()) ++*skipped;
      continue;
    }
    const std::size_t second = line.find(' ', space + 1);
    event.name = line.substr(space + 1, second == std::string::npos ? second : second - space - 1);
    if (second != std::string::npos) event.text = line.substr(second + 1);
    events.push_back(event);
  }
  return events;
}

}  // namespace swiftlet
