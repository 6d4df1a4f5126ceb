/* Two threads of a program for SOEM 1.4 read words of one EEPROM while a third one configures the slave again: each has
   its own word or none: eeprom_threads SOURCE SLAVE */
#include <ethercat.h>

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>

enum { READINGS = 300, READERS = 2 };

static uint16 slave;
static volatile int reading = READERS;
static int right[READERS], wrong[READERS];
static const uint16 words[READERS] = {8, 10};

static void* read_words(void* of) {
    const int n = *(const int*)of;
    const uint32 own = n == 0 ? ec_slave[slave].eep_man : ec_slave[slave].eep_id;
    int count;
    for (count = 0; count < READINGS; ++count) {
        const uint32 value = ec_readeeprom(slave, words[n], EC_TIMEOUTEEP);
        right[n] += value == own;
        wrong[n] += value != own && value != 0;
    }
    __sync_fetch_and_sub(&reading, 1);
    return NULL;
}

int main(int argc, char** argv) {
    static const int numbers[READERS] = {0, 1};
    pthread_t threads[READERS];
    int n, configured = 0;
    if (argc != 3) return 2;
    slave = (uint16)atoi(argv[2]);
    if (!ec_init(argv[1]) || ec_config_init(FALSE) < slave) return 1;
    for (n = 0; n < READERS; ++n) pthread_create(&threads[n], NULL, read_words, (void*)&numbers[n]);
    while (reading > 0) {
        configured += ec_reconfig_slave(slave, 500) != 0;
        osal_usleep(5000);
    }
    for (n = 0; n < READERS; ++n) pthread_join(threads[n], NULL);
    printf("right %d and %d, wrong %d and %d, configured %d times\n", right[0], right[1], wrong[0], wrong[1],
           configured);
    ec_close();
    return wrong[0] + wrong[1] == 0 && right[0] > READINGS / 2 && right[1] > READINGS / 2 && configured > 0 ? 0 : 1;
}
