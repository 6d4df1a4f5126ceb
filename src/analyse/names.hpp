// Identity, names and PDOs of a slave, from its SII and its object dictionary as far as the recording shows them.
#pragma once

#include "analyse/slave_tracks.hpp"

namespace margay::analyse {

void name_slave(Slave& facts, const SlaveTrack& track);

}  // namespace margay::analyse
