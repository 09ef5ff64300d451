// A first start asks for no account, opens no page of the internet and shows no notice.
pref("mail.provider.suppress_dialog_on_startup", true);
pref("mailnews.start_page.enabled", false);
pref("mail.inappnotifications.enabled", false);
pref("mail.rights.version", 1);
pref("datareporting.policy.dataSubmissionPolicyBypassNotification", true);
