// The parts of the reader of ESI files.
#pragma once

#include "files/xml.hpp"

#include <margay/files/esi.hpp>

namespace margay::files {

// PDOs, and the commands of a mailbox, of a device or of a module.
[[nodiscard]] EsiPdo read_esi_pdo(Reader& reader, Node node, Direction direction);
[[nodiscard]] std::vector<EsiPdo> read_esi_pdos(Reader& reader, Node parent);
[[nodiscard]] EsiMailbox read_esi_mailbox(Reader& reader, Node node);
[[nodiscard]] std::vector<EsiMode> read_esi_modes(Reader& reader, Node dc);
[[nodiscard]] EsiSlots read_esi_slots(Reader& reader, Node node);
[[nodiscard]] EsiModule read_esi_module(Reader& reader, Node node);
[[nodiscard]] EsiEeprom read_esi_eeprom(Reader& reader, Node node);
// The objects of all dictionaries of the profiles.
[[nodiscard]] std::vector<EsiObject> read_esi_dictionary(Reader& reader, Node device);
[[nodiscard]] EsiDevice read_esi_device(Reader& reader, Node node);

// Of several elements with this name: the English one, otherwise the first.
[[nodiscard]] std::string english(Node parent, const char* name);
// The transitions of a command, by its elements Transition. A remark reports transitions that this library does not
// know (for example PP), and the result does not contain them.
[[nodiscard]] Transition read_transitions(Reader& reader, Node command);

}  // namespace margay::files
