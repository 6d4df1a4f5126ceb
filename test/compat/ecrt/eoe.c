/* A slave with EoE gets a network interface. The stack of the kernel at the other end answers through it, before
 * activation and beside the cycle. Ends with 77 where the system has no TAP devices. */
#define _DEFAULT_SOURCE
#include "check.h"
#include "cycle.h"

#include <ecrt.h>

#include <arpa/inet.h>
#include <errno.h>
#include <net/if.h>
#include <netinet/in.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#define NAME "eoe0s1"

static ec_master_t* master;
static ec_domain_t* domain;

static void one_cycle(void) {
    next_cycle();
    ecrt_master_receive(master);
    ecrt_domain_process(domain);
    ecrt_domain_queue(domain);
    ecrt_master_send(master);
    ecrt_master_eoe_process(master);
}

static int set_address(const char* address) {
    struct ifreq request;
    struct sockaddr_in* to = (struct sockaddr_in*)&request.ifr_addr;
    const int any = socket(AF_INET, SOCK_DGRAM, 0);
    int result;
    memset(&request, 0, sizeof request);
    strcpy(request.ifr_name, NAME);
    to->sin_family = AF_INET;
    inet_pton(AF_INET, address, &to->sin_addr);
    result = ioctl(any, SIOCSIFADDR, &request);
    if (result == 0) {
        inet_pton(AF_INET, "255.255.255.0", &to->sin_addr);
        result = ioctl(any, SIOCSIFNETMASK, &request);
    }
    close(any);
    return result;
}

/* Sends to a port without a program until the other end has refused it, which proves both directions. */
static int refused_by(const char* address, int cycling) {
    struct sockaddr_in to = {0};
    char octet = 0;
    int n, refused = 0;
    const int any = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    to.sin_family = AF_INET;
    to.sin_port = htons(9);
    inet_pton(AF_INET, address, &to.sin_addr);
    connect(any, (struct sockaddr*)&to, sizeof to);
    for (n = 0; n < 20000 && !refused; ++n) {
        if (n % 100 == 0) refused = send(any, &octet, 1, 0) < 0 && errno == ECONNREFUSED;
        if (recv(any, &octet, 1, 0) < 0) refused |= errno == ECONNREFUSED;
        if (cycling)
            one_cycle();
        else
            next_cycle();
    }
    close(any);
    return refused;
}

int main(void) {
    ec_slave_info_t info;
    ec_slave_config_t* sc;
    ec_master_state_t state;
    int n;
    if (access("/dev/net/tun", R_OK | W_OK) != 0) {
        printf("skipped: no TAP devices here: /dev/net/tun\n");
        return 77;
    }
    master = ecrt_request_master(0);
    CHECK(master != NULL);
    CHECK(ecrt_master_eoe_is_open(master) == 0);
    CHECK(ecrt_master_eoe_delif(master, 0, 1) == -ENOENT);
    CHECK(ecrt_master_eoe_addif(master, 0, 0) == -EOPNOTSUPP);
    CHECK(ecrt_master_eoe_addif(master, 0, 99) == -ENOENT);
    CHECK(ecrt_master_eoe_addif(master, 99, 0) == -ENOENT);
    CHECK(ecrt_master_eoe_addif(master, 0, 1) == 0);
    CHECK(ecrt_master_eoe_addif(master, 0, 1) == -EEXIST);
    CHECK(ecrt_master_eoe_is_open(master) == 1);
    CHECK(if_nametoindex(NAME) != 0);
    CHECK(set_address("192.168.77.1") == 0);
    CHECK(refused_by("192.168.77.2", 0));

    domain = ecrt_master_create_domain(master);
    CHECK(ecrt_master_get_slave(master, 1, &info) == 0);
    sc = ecrt_master_slave_config(master, 0, 1, info.vendor_id, info.product_code);
    CHECK(sc != NULL && ecrt_master_activate(master) == 0);
    for (n = 0; n < 20000; ++n) {
        one_cycle();
        ecrt_master_state(master, &state);
        if ((state.al_states & EC_AL_STATE_OP) != 0) break;
    }
    CHECK(n < 20000);
    CHECK(refused_by("192.168.77.2", 1));

    CHECK(ecrt_master_eoe_delif(master, 0, 1) == 0);
    CHECK(if_nametoindex(NAME) == 0);
    CHECK(ecrt_master_eoe_is_open(master) == 0);
    CHECK(ecrt_master_eoe_delif(master, 0, 1) == -ENOENT);
    for (n = 0; n < 10; ++n) one_cycle();
    /* And once more: the port of the first one is over. */
    CHECK(ecrt_master_eoe_addif(master, 0, 1) == 0);
    ecrt_release_master(master);
    CHECK(if_nametoindex(NAME) == 0);
    return 0;
}
