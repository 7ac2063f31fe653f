#pragma once
// Makes text valid for XML 1.0: markup is escaped; what XML cannot contain (control characters, invalid
// UTF-8) is replaced by '?'.

#include <string>
#include <string_view>

namespace swiftlet {

enum class XmlPlace {
  kAttribute,  ///< between double quotes: line ends and tabs as references, or a parser makes them spaces
  kContent,    ///< between tags
};

std::string xmlText(std::string_view text, XmlPlace place = XmlPlace::kAttribute);

}  // namespace swiftlet
