// Names that stand beside a structure without one.
#pragma once

#include <optional>
#include <string>

#include "estimator/diagnosis/search.h"

namespace plumbline {

/// What has a name and what has none, of one driver, one form and one axis (or the head), is
/// sooner one structure, of which the listed shape is a part, than two causes that happen to share
/// all three. Such names become parts (ActiveEffect::part_of), unless the structure is but a small
/// remnant of what the name stands for. A pose at a wrong angle is one as well where structures
/// move the head about as far: there the structure may be another than its function says. Three
/// steps of an axis, or slips of the index, that go to and fro are parts of something that
/// switches.
void mark_parts_of_structures(const VisitLog& log, SearchResult& found);

/// What is reported of an effect that has no name or is a part of what has none; else nothing.
struct StructureName {
  std::string driver, form, shape;  ///< as those of UnlistedStructure
};
std::optional<StructureName> structure_name(const ActiveEffect& active);
/// The id of the listed effect that a reported part runs like; nothing for any other shape.
std::optional<std::string> part_like(const std::string& shape);

}  // namespace plumbline
