// The program of another project that reads recordings.
#include <margay/parts/oshw/pcap/capture_file.hpp>

int main() {
    margay::CaptureFile file;
    return !file.load("/no-such-recording.pcap") && !file.problem().empty() ? 0 : 1;
}
