#pragma once
// Text made fit for XML 1.0: markup escaped, and what XML cannot hold (control characters, bytes that are no
// UTF-8) replaced by '?'.

#include <string>
#include <string_view>

namespace swiftlet {

enum class XmlPlace {
  kAttribute,  ///< between double quotes: line ends and tabs as references, or a parser makes them spaces
  kContent,    ///< between tags
};

std::string xmlText(std::string_view text, XmlPlace place = XmlPlace::kAttribute);

}  // namespace swiftlet
