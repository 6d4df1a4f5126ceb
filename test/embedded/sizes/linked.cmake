# Checks by the linker maps which parts of the library each program of the table contains. A part is a member of the
# archive, or a function if the member has functions of several parts. The programs that call a part must contain it,
# and no other program may contain it.
set(with_sdo ${programs})
list(REMOVE_ITEM with_sdo cycle dictionary)
set(with_dictionary ${programs})
list(REMOVE_ITEM with_dictionary cycle sdo_alone)
set(with_mail ${programs})
list(REMOVE_ITEM with_mail cycle)
set(supervised supervision reach everything)

# The program for scan and process data alone has no code for mail.
only_members("channel channel_dispatch channel_owed coe_sdo coe_transfer late_answers" ${with_mail})
only("(14MailboxChannel4pump|MailSession|[^a-z]sdo_|run_transfer|watch_all|owe_|7deliver.*FinalMessage)" ${with_mail})
only_members("sdo mail coe_complete" ${with_sdo})
only_members("coe_pdo" ${with_dictionary})
only("ask_dictionary" ${with_dictionary})
only("(find_sms_by_coe|read_sm_types|SdoList)" ${with_dictionary})

# The parts that programs have in addition to SDO reading.
only("sdo_download" sdo_write startup pdo_write everything)
only_members("coe_information sdo_information" sdo_information everything)
only_members("device_id group_comparison" expected everything)
only("(compare_with_expected|read_device_id|compare_group|identify_as_expected)" expected everything)
only_members("startup" startup everything)
only("(run_commands|invalid_commands)" startup everything)
only_members("coe_pdo_write" pdo_write everything)
only("write_sm_pdos" pdo_write everything)
only_members("soe soe_transfer" soe everything)
only("soe_" soe everything)
only_members("mail_order listener_watch" soe eoe everything)
only_members("eoe eoe_port eoe_relay hooked_slave mail_check" eoe everything)
only("eoe_" eoe everything)
only_members("supervision supervisor line_errors" ${supervised})
only("(9supervise|find_lost|address_newcomer)" ${supervised})
only_members("ring_reading" ${supervised} expected)
only("read_places" ${supervised} expected)
only_members("run" reach)
only_members("describe argument_text" texts everything)
only("8describeE" texts everything)

# The features of init().
only_members("boot soe_pdo" everything)
only("(prove_in_boot|forward_mail|send_overlapped)" everything)

# No program calls these parts.
nowhere(
  aoe aoe_listener clock_delays clock_kind clock_sync clock_watch clocks coe_mail_pdo coe_stream datagram describe_event entry
  entry_names external_clock foe foe_transfer frame_times hooked hooked_file hooked_mail latches link_layer_clock listen mail_pdo
  mailbox_places master_clock phase_controller raw_mail redundancy redundancy_merge redundancy_opening
  redundancy_pairs redundancy_probe redundancy_status redundancy_time reference_clock registers replan ring_clocks ring_rates
  ring_watch ring_ways
  sdo_stream sii sii_write soe_listener startup_aoe startup_eoe startup_soe sync_signals voe voe_inbox)
