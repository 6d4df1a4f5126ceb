/* Two threads of a program for SOEM 1.4 make the same calls: each gets what is its own: two_threads SOURCE
   The two slaves of the source have different names and products. */
#include <ethercat.h>

#include <pthread.h>
#include <stdio.h>
#include <string.h>

#include "must.h"

enum { CALLS = 100 };

static char IOmap[4096];
static const char* source;
static int wrong, hooks;
static char names[3][EC_MAXNAME + 1];

static void count_wrong(int is_wrong) {
    if (is_wrong) __sync_fetch_and_add(&wrong, 1);
}

/* The strings of the SII of two slaves. */
static void* read_strings(void* of) {
    const uint16 slave = *(const uint16*)of;
    char text[EC_MAXNAME + 1];
    int n;
    for (n = 0; n < CALLS; ++n) {
        text[0] = '\0';
        ec_siistring(text, slave, 1);
        count_wrong(strcmp(text, names[slave]) != 0);
    }
    return NULL;
}

/* Two words of the EEPROM of one slave, in two calls each. */
static void* read_halves(void* of) {
    const uint16 word = *(const uint16*)of == 1 ? 8 : 10;
    const uint32 own = word == 8 ? ec_slave[2].eep_man : ec_slave[2].eep_id;
    int n;
    for (n = 0; n < CALLS; ++n) {
        ec_readeeprom1(2, word);
        count_wrong(ec_readeeprom2(2, 100 * EC_TIMEOUTEEP) != own); /* on a busy machine too */
    }
    return NULL;
}

/* Each success has called the hook. */
static int hook(uint16 slave) {
    (void)slave;
    __sync_fetch_and_add(&hooks, 1);
    return 1;
}
static int configured;
static void* configure(void* of) {
    int n;
    (void)of;
    for (n = 0; n < 20; ++n)
        if (ec_reconfig_slave(2, 500) == EC_STATE_SAFE_OP) __sync_fetch_and_add(&configured, 1);
    return NULL;
}

/* Mail of slave 2: one call waits for it while another one gives up, and the mail comes afterwards. */
static int received;
static void* wait_long(void* of) {
    ec_mbxbuft mail;
    (void)of;
    ec_clearmbx(&mail);
    received = ec_mbxreceive(2, &mail, 5000000);
    return NULL;
}
static void mail_behind_a_call_that_gives_up(void) {
    ec_mbxbuft mail;
    uint8* const octets = (uint8*)&mail;
    pthread_t waiting;
    pthread_create(&waiting, NULL, wait_long, NULL);
    osal_usleep(20000);
    ec_clearmbx(&mail);
    MUST(ec_mbxreceive(2, &mail, 10000) == 0);
    osal_usleep(20000);
    ec_clearmbx(&mail);
    octets[0] = 10;   /* length */
    octets[5] = 0x03; /* CoE */
    octets[7] = 0x20; /* SDO request */
    octets[8] = 0x40; /* upload of 0x1000:00 */
    octets[10] = 0x10;
    MUST(ec_mbxsend(2, &mail, EC_TIMEOUTTXM) == 1);
    pthread_join(waiting, NULL);
    MUST(received == 1);
}

/* Each thread that reserves a frame index has it alone. */
static int users[EC_MAXBUF];
static void* reserve(void* of) {
    int n;
    volatile int used;
    (void)of;
    for (n = 0; n < 3000000; ++n) {
        const int index = ec_getindex();
        count_wrong(__sync_fetch_and_add(&users[index], 1) != 0);
        for (used = 0; used < 20; ++used) continue;
        __sync_fetch_and_sub(&users[index], 1);
        ec_setbufstat(index, EC_BUF_EMPTY);
    }
    return NULL;
}

/* Many threads, each with a frame of its own. There are fewer indexes, or the threads give none back: each frame
   is the own one, or there is none. */
static int gives_back, confirmed;
static void* confirm(void* of) {
    int n;
    (void)of;
    for (n = 0; n < 200; ++n) {
        const uint16 address = ec_slave[1 + n % 2].configadr;
        const int index = ec_getindex();
        uint16 word = 0;
        int wkc;
        ec_setupdatagram(&ecx_port.txbuf[index], EC_CMD_FPRD, (uint8)index, address, ECT_REG_STADR, 2, &word);
        wkc = ec_srconfirm(index, EC_TIMEOUTRET3);
        memcpy(&word, &ecx_port.rxbuf[index][EC_HEADERSIZE], sizeof(word));
        if (wkc >= 0) count_wrong(wkc != 1 || etohs(word) != address);
        if (wkc == 1) __sync_fetch_and_add(&confirmed, 1);
        if (gives_back) ec_setbufstat(index, EC_BUF_EMPTY);
    }
    return NULL;
}
static void more_threads_than_indexes(void) {
    pthread_t threads[EC_MAXBUF + 4];
    int n;
    for (n = 0; n < EC_MAXBUF + 4; ++n) pthread_create(&threads[n], NULL, confirm, NULL);
    for (n = 0; n < EC_MAXBUF + 4; ++n) pthread_join(threads[n], NULL);
}

/* One thread sends a frame more than there are indexes: the first frame is given up, and the others come. */
static void one_frame_too_many(void) {
    int index[EC_MAXBUF + 1];
    int n, empty = 0;
    uint16 word = 0;
    for (n = 0; n <= EC_MAXBUF; ++n) {
        index[n] = ec_getindex();
        ec_setupdatagram(&ecx_port.txbuf[index[n]], EC_CMD_FPRD, (uint8)index[n], ec_slave[1].configadr, ECT_REG_STADR, 2,
                         &word);
        count_wrong(ecx_outframe(&ecx_port, index[n], 0) <= 0);
    }
    count_wrong(index[EC_MAXBUF] != index[0]);
    for (n = 1; n <= EC_MAXBUF; ++n) {
        count_wrong(ecx_waitinframe(&ecx_port, index[n], EC_TIMEOUTRET3) != 1);
        ec_setbufstat(index[n], EC_BUF_EMPTY);
    }
    for (n = 0; n < EC_MAXBUF; ++n) empty += ecx_port.rxbufstat[n] == EC_BUF_EMPTY;
    count_wrong(empty != EC_MAXBUF);
}

/* Both threads open the same port: one session stays, and the others end. */
static void* open_port(void* of) {
    int n;
    (void)of;
    for (n = 0; n < 200; ++n) count_wrong(ecx_setupnic(&ecx_port, source, FALSE) != 1);
    return NULL;
}

static void by_two_threads(void* (*calls)(void*)) {
    static const uint16 numbers[2] = {1, 2};
    pthread_t threads[2];
    int n;
    for (n = 0; n < 2; ++n) pthread_create(&threads[n], NULL, calls, (void*)&numbers[n]);
    for (n = 0; n < 2; ++n) pthread_join(threads[n], NULL);
}

int main(int argc, char** argv) {
    int slave;
    if (argc != 2 || !ec_init(argv[1]) || ec_config_init(FALSE) != 2) return 1;
    for (slave = 1; slave <= 2; ++slave) ec_siistring(names[slave], (uint16)slave, 1);
    MUST(strcmp(names[1], names[2]) != 0);
    by_two_threads(reserve);
    MUST(wrong == 0);
    by_two_threads(confirm); /* all indexes are left behind */
    MUST(wrong == 0 && confirmed > 0);
    ecx_init(&ecx_context, argv[1]);
    MUST(ec_config_init(FALSE) == 2);
    gives_back = 1;
    confirmed = 0;
    more_threads_than_indexes();
    MUST(wrong == 0 && confirmed > 0);
    by_two_threads(read_strings);
    MUST(wrong == 0);
    by_two_threads(read_halves);
    MUST(wrong == 0);
    ec_slave[2].PO2SOconfig = hook;
    ec_config_map(&IOmap);
    hooks = 0;
    by_two_threads(configure);
    printf("configured %d times, hooks %d\n", configured, hooks);
    MUST(configured > 0 && hooks >= configured);
    mail_behind_a_call_that_gives_up();
    one_frame_too_many();
    source = argv[1];
    by_two_threads(open_port);
    ec_close();
    return wrong != 0;
}
